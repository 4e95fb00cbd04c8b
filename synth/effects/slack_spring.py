"""A one-sided spring: −stiffness·(θ − slack) above an angle, nothing below it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from synth.effects.effect import Dynamics, Effect
from synth.section import Finite, Positive


class SlackSpring(Effect):
    """A spring that can only pull."""

    id: ClassVar[str] = "slack_spring"
    order: ClassVar[int] = 190

    stiffness: Positive
    """1/s²."""
    slack_deg: Finite = 0.0
    """Angle above which it pulls."""

    def dynamics(self) -> Dynamics:
        """Return the spring."""
        return _OneSidedSpring(self.stiffness, math.radians(self.slack_deg))


EFFECT = SlackSpring


@dataclass(frozen=True)
class _OneSidedSpring(Dynamics):
    stiffness: float
    angle: float

    has_edge = True

    def torque(self, theta: float, omega: float, own: list[float], above: bool) -> float:
        return -(self.stiffness * (theta - self.angle)) if above else 0.0

    def edge(self, theta: float) -> float:
        return theta - self.angle
