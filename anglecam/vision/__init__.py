"""Images as arrays: from pixels to marks, pivots and rotations in pixels. Nothing here knows about files or angles."""
