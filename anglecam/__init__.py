"""From clips of a moving mechanism to its angle, its model, and what the model lacks."""

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from anglecam.errors import AnglecamError, InputError, RigError

if TYPE_CHECKING:
    from anglecam.api import close_loop, identify, measure

__version__ = version("anglecam")

__all__ = ["AnglecamError", "InputError", "RigError", "__version__", "close_loop", "identify", "measure"]


def __getattr__(name: str) -> Any:
    """Import the functions when they are asked for: estimators and their libraries take a second that few need."""
    if name in ("close_loop", "identify", "measure"):
        return getattr(import_module("anglecam.api"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
