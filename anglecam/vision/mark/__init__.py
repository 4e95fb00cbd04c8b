"""Find and follow the declared mark: colour, segmentation, blobs, tracking."""
