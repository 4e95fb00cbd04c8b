"""Films as files: frames with their own timestamps, read forward, and the overlay written back."""
