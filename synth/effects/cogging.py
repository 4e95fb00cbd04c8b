"""Cogging: the drive pulls towards evenly spaced angles, amplitude·sin(periods_per_turn·θ + phase)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from synth.effects.effect import Dynamics, Effect
from synth.section import Finite, Positive


class Cogging(Effect):
    """A torque that is periodic in the head's angle."""

    id: ClassVar[str] = "cogging"
    order: ClassVar[int] = 125

    amplitude: Positive
    """rad/s²."""
    periods_per_turn: Positive
    phase: Finite = 0.0
    """rad, at neutral."""

    def dynamics(self) -> Dynamics:
        """Return the periodic torque."""
        return _Cogs(self.amplitude, self.periods_per_turn, self.phase)


EFFECT = Cogging


@dataclass(frozen=True)
class _Cogs(Dynamics):
    amplitude: float
    periods: float
    phase: float

    def torque(self, theta: float, omega: float, own: list[float], above: bool) -> float:
        return self.amplitude * math.sin(self.periods * theta + self.phase)
