"""A torque that wanders: a random walk, straight between its steps."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from synth.effects.effect import Dynamics, Effect
from synth.section import Positive

STEP_S, LONGEST_S = 0.1, 120.0


class TorqueWalk(Effect):
    """A random walk."""

    id: ClassVar[str] = "torque_walk"
    order: ClassVar[int] = 280

    spread: Positive
    """Standard deviation after one second, rad/s²."""
    number: Annotated[int, Field(ge=0)] = 0
    """Seed of the walk."""

    def dynamics(self) -> Dynamics:
        """Return the walk."""
        steps = np.random.default_rng(self.number).normal(
            0.0, self.spread * math.sqrt(STEP_S), round(LONGEST_S / STEP_S)
        )
        return _Walk(np.concatenate([[0.0], np.cumsum(steps)]))


EFFECT = TorqueWalk


class _Walk(Dynamics):
    def __init__(self, levels: np.ndarray) -> None:
        self._times, self._levels = STEP_S * np.arange(len(levels)), levels

    def disturbance(self, t: float) -> float:
        return float(np.interp(t, self._times, self._levels))
