"""A periodic torque from outside: amplitude·sin(2π·f·t + phase)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from synth.effects.effect import Dynamics, Effect
from synth.section import Finite, Positive


class PeriodicDisturbance(Effect):
    """A sinusoidal torque."""

    id: ClassVar[str] = "periodic_disturbance"
    order: ClassVar[int] = 210

    amplitude: Positive
    """rad/s²."""
    frequency_hz: Positive
    phase: Finite = 0.0
    """rad, at time 0 of each recording."""

    def dynamics(self) -> Dynamics:
        """Return the torque."""
        return _Sine(self.amplitude, 2 * math.pi * self.frequency_hz, self.phase)


EFFECT = PeriodicDisturbance


@dataclass(frozen=True)
class _Sine(Dynamics):
    amplitude: float
    rate: float
    """rad/s."""
    phase: float

    def disturbance(self, t: float) -> float:
        return self.amplitude * math.sin(self.rate * t + self.phase)
