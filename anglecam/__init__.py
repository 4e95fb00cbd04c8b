"""From clips of a moving mechanism to its angle, its model, and what the model lacks."""

from importlib.metadata import version

__version__ = version("anglecam")

from anglecam.api import close_loop, identify, measure
from anglecam.errors import AnglecamError, InputError, RigError

__all__ = ["AnglecamError", "InputError", "RigError", "__version__", "close_loop", "identify", "measure"]
