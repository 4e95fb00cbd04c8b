"""The next experiment: the recording that best distinguishes models which describe the recordings so far alike."""
