"""A detent: one notch holds the head near one angle, −force·(x/width)·e^((1 − (x/width)²)/2) with x = θ − angle."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from synth.effects.effect import Dynamics, Effect
from synth.section import Finite, Positive


class Detent(Effect):
    """A notch at a single angle."""

    id: ClassVar[str] = "detent"
    order: ClassVar[int] = 240

    force: Positive
    """Largest torque, rad/s²."""
    angle_deg: Finite
    width_deg: Positive
    """Distance from the angle at which the torque is largest."""

    def dynamics(self) -> Dynamics:
        """Return the notch."""
        return _Notch(self.force, math.radians(self.angle_deg), math.radians(self.width_deg))


EFFECT = Detent


@dataclass(frozen=True)
class _Notch(Dynamics):
    force: float
    angle: float
    width: float

    def torque(self, theta: float, omega: float, own: list[float], above: bool) -> float:
        x = (theta - self.angle) / self.width
        return -self.force * x * math.exp((1 - x * x) / 2)
