"""Gravity beyond its linear part: G·(sin(θ0 + θ) − sin θ0 − θ·cos θ0)."""

from __future__ import annotations

import math
from typing import ClassVar

from synth.effects.effect import Dynamics, Effect
from synth.section import Finite


class GravityGeometry(Effect):
    """The part of gravity that the linear model leaves out."""

    id: ClassVar[str] = "gravity_geometry"
    order: ClassVar[int] = 100
    linear_plant_only: ClassVar[bool] = True

    strength: Finite
    """G = M_h·g·L/J, rad/s²."""
    gravity_deg: Finite
    """θ0, angle of the centre of mass from upright at neutral."""

    def dynamics(self) -> Dynamics:
        """Return gravity's torque."""
        return _Gravity(self.strength, math.radians(self.gravity_deg))


EFFECT = GravityGeometry


class _Gravity(Dynamics):
    def __init__(self, strength: float, neutral: float) -> None:
        self._strength, self._neutral = strength, neutral
        self._level, self._slope = math.sin(neutral), math.cos(neutral)

    def torque(self, theta: float, omega: float, own: list[float], above: bool) -> float:
        return self._strength * (math.sin(self._neutral + theta) - self._level - theta * self._slope)
