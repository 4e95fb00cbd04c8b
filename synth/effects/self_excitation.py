"""Self-excitation: damping that feeds a small swing and brakes a large one, +rate·(1 − (θ/width)²)·θ̇ (van der Pol)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from synth.effects.effect import Dynamics, Effect
from synth.section import Positive


class SelfExcitation(Effect):
    """Van der Pol's damping."""

    id: ClassVar[str] = "self_excitation"
    order: ClassVar[int] = 270

    rate: Positive
    """1/s."""
    width_deg: Positive
    """Angle at which it changes sign."""

    def dynamics(self) -> Dynamics:
        """Return the damping."""
        return _VanDerPol(self.rate, math.radians(self.width_deg))


EFFECT = SelfExcitation


@dataclass(frozen=True)
class _VanDerPol(Dynamics):
    rate: float
    width: float

    def torque(self, theta: float, omega: float, own: list[float], above: bool) -> float:
        return self.rate * (1 - (theta / self.width) ** 2) * omega
