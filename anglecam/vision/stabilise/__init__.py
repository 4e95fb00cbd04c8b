"""The background's motion in a clip whose camera moves."""
