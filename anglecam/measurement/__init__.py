"""From pixels to angles: the coarse pass, the fine pass, the angle's standard uncertainty."""
