"""Closing the loop: test whether the model lacks something, attribute it to an effect, and validate that effect."""
