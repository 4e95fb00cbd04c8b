"""The camera: its calibration, lens, tilt and shutter."""
