"""Tracks of points that another program has found in a clip: DeepLabCut and SLEAP."""
