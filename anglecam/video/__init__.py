"""Films: frames with their time stamps, read forward, and the overlay that is written."""
