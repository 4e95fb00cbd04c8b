"""What the command line, the batch and the Python API all call: one clip, one session."""
