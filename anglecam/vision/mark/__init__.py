"""Find the declared mark in a clip and follow it: colour, segmentation, blobs, tracking."""
