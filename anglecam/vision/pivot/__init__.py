"""Find the centre of rotation: a round marker, the circle of a mark's path, or both."""
