"""From clips of a moving mechanism to its angle, its model, and what the model lacks."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from anglecam.errors import AnglecamError, InputError, RigError

if TYPE_CHECKING:
    from anglecam.api import close_loop, identify, measure
    from anglecam.data.series import AngleSeries
    from anglecam.effects import Effect
    from anglecam.io.rig import Rig
    from anglecam.io.session import Session
    from anglecam.loop.verdict import Verdict

    __version__: str

_HOME = {
    "measure": "anglecam.api",
    "identify": "anglecam.api",
    "close_loop": "anglecam.api",
    "AngleSeries": "anglecam.data.series",
    "Effect": "anglecam.effects",
    "Rig": "anglecam.io.rig",
    "Session": "anglecam.io.session",
    "Verdict": "anglecam.loop.verdict",
}
"""Modules of the public names; each is loaded when one of its names is first used, to keep the start-up short."""
_WITH_KERNELS = ("anglecam.api", "anglecam.effects", "anglecam.loop.verdict")
"""Of these modules, those that load compiled functions."""

__all__ = [
    "AngleSeries",
    "AnglecamError",
    "Effect",
    "InputError",
    "Rig",
    "RigError",
    "Session",
    "Verdict",
    "__version__",
    "close_loop",
    "identify",
    "measure",
]


def __getattr__(name: str) -> Any:
    if name in _HOME:
        if _HOME[name] in _WITH_KERNELS:
            from anglecam.prepare import prepare_kernels

            prepare_kernels(__name__)
        return getattr(import_module(_HOME[name]), name)
    if name == "__version__":
        from importlib.metadata import version  # reads the whole library of e-mail headers

        return version("anglecam")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
