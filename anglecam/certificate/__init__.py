"""A servo's certificate: backlash, friction, delay and limits with 95 % intervals, from the recordings alone."""
