"""The background's motion in a clip whose camera does not stand still."""
