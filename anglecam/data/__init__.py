"""What passes between rooms: plain frozen dataclasses, without file formats and without computation of their own."""
