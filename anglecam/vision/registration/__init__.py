"""The rotation of a rigid body from many small tiles, whose appearance is learnt from the clip itself."""
