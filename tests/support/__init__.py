"""Test films, sessions and bad inputs; independent of anglecam's measuring code."""
