"""Marks that another program has found in the clip, in place of our own vision: DeepLabCut and SLEAP."""
