"""Plain trackers for real films, as an independent opinion of the angle: OpenCV and NumPy, nothing of anglecam."""
