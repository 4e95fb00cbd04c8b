"""Closing the loop: is anything missing from the model, what is it, and does it prove itself on new data."""
