"""Find the centre of rotation: a round marker, the centre of the mark's circular path, or both."""
