"""From clips of a moving mechanism to its angle, its model, and what the model lacks."""

from importlib.metadata import version

__version__ = version("anglecam")
