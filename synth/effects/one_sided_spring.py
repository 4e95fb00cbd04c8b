"""A one-sided spring: −|stiffness|·(θ − slack) on one side of an angle, nothing on the other.

It acts above the angle if the stiffness is positive, below it if the stiffness is negative.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from synth.effects.effect import Dynamics, Effect
from synth.section import Finite


class OneSidedSpring(Effect):
    """A spring that can only pull."""

    id: ClassVar[str] = "one_sided_spring"
    order: ClassVar[int] = 190

    stiffness: Finite
    """1/s²; the sign states the side."""
    slack_deg: Finite = 0.0
    """Angle beyond which it pulls."""

    def dynamics(self) -> Dynamics:
        """Return the spring."""
        return _OneSidedSpring(abs(self.stiffness), self.stiffness > 0, math.radians(self.slack_deg))


EFFECT = OneSidedSpring


@dataclass(frozen=True)
class _OneSidedSpring(Dynamics):
    stiffness: float
    pulls_above: bool
    angle: float

    has_edge = True

    def torque(self, theta: float, omega: float, own: list[float], above: bool) -> float:
        return -(self.stiffness * (theta - self.angle)) if above == self.pulls_above else 0.0

    def edge(self, theta: float) -> float:
        return theta - self.angle
