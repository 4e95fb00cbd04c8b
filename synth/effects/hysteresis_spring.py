"""A spring with hysteresis: strands that rub on one another, as in a rope or a cable, after Bouc and Wen.

    torque = −force·z,   ż = (θ̇ − |θ̇|·z·|z|)/width        |z| ≤ 1: at first a spring, then a slider

Wen, J. Eng. Mech. Div. ASCE 102, 1976; here with the exponent 2 and equal constants.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from synth.effects.effect import Dynamics, Effect, StateVariable
from synth.section import Positive


class HysteresisSpring(Effect):
    """A spring that yields."""

    id: ClassVar[str] = "hysteresis_spring"
    order: ClassVar[int] = 230
    states: ClassVar[tuple[StateVariable, ...]] = (StateVariable("yield_share", "1"),)

    force: Positive
    """Torque at which it yields, rad/s²."""
    width_deg: Positive
    """Angle within which it yields."""

    def dynamics(self) -> Dynamics:
        """Return the spring."""
        return _Yielding(self.force, math.radians(self.width_deg))


EFFECT = HysteresisSpring


@dataclass(frozen=True)
class _Yielding(Dynamics):
    force: float
    width: float

    reverses = True

    def torque(self, theta: float, omega: float, own: list[float], above: bool) -> float:
        return -self.force * own[0]

    def rates(self, omega: float, acceleration: float, own: list[float]) -> list[float]:
        return [(omega - abs(omega) * own[0] * abs(own[0])) / self.width]
