"""The effects that a spec can switch on: every module here that defines ``EFFECT``. To add an effect, add a file.

θ is the head's angle, u the command, and torques are angular accelerations: rad/s². Effects that anglecam can detect
carry the id that it uses; `hysteresis_spring`, `detent`, `shifted_load`, `wind_gusts`, `self_excitation` and
`torque_walk` exist only here, so that anglecam is tested on structure that none of its effects explains.
"""

from __future__ import annotations

import importlib
import pkgutil

from synth.effects.effect import Dynamics, Effect, StateVariable
from synth.effects.piecewise import PiecewiseLinear

__all__ = ["REGISTRY", "Dynamics", "Effect", "PiecewiseLinear", "StateVariable"]


def _collect() -> tuple[type[Effect], ...]:
    modules = (importlib.import_module(f"{__name__}.{m.name}") for m in pkgutil.iter_modules(__path__))
    return tuple(sorted((m.EFFECT for m in modules if hasattr(m, "EFFECT")), key=lambda e: (e.order, e.id)))


REGISTRY: tuple[type[Effect], ...] = _collect()
"""All effects, in the order in which they act."""
