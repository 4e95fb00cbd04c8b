"""Pictures as arrays: from images to marks (mouth, pivot) in pixels. Nothing here knows about files or angles."""
