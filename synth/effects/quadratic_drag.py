"""Quadratic drag, −q·θ̇·|θ̇|."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from synth.effects.effect import Dynamics, Effect
from synth.section import NotNegative


class QuadraticDrag(Effect):
    """−q·θ̇·|θ̇|."""

    id: ClassVar[str] = "quadratic_drag"
    order: ClassVar[int] = 80

    q: NotNegative
    """1/rad."""

    def dynamics(self) -> Dynamics:
        """Return the drag."""
        return _Drag(self.q)


EFFECT = QuadraticDrag


@dataclass(frozen=True)
class _Drag(Dynamics):
    q: float

    reverses = True  # its second derivative jumps at θ̇ = 0

    def torque(self, theta: float, omega: float, own: list[float], above: bool) -> float:
        return -self.q * omega * abs(omega)
