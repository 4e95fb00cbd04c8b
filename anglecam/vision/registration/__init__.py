"""The rotation of a rigid body from many small tiles, each learnt from the clip itself."""
