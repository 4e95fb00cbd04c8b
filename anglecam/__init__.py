"""From clips of a moving mechanism to its angle, its model, and what the model lacks."""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from anglecam.errors import AnglecamError, InputError, RigError

if TYPE_CHECKING:
    from anglecam.api import close_loop, identify, measure

__all__ = ["AnglecamError", "InputError", "RigError", "__version__", "close_loop", "identify", "measure"]
__version__ = version("anglecam")


def __getattr__(name: str) -> Any:
    """Load what measures and fits when it is first asked for: a program that needs one room starts without the rest."""
    if name in __all__:
        return getattr(import_module("anglecam.api"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
