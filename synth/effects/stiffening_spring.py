"""A spring that stiffens or softens with angle, −k3·θ³."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from synth.effects.effect import Dynamics, Effect
from synth.section import Finite


class StiffeningSpring(Effect):
    """−k3·θ³; negative k3 softens."""

    id: ClassVar[str] = "stiffening_spring"
    order: ClassVar[int] = 90

    k3: Finite
    """1/(s²·rad²)."""

    def dynamics(self) -> Dynamics:
        """Return the cubic spring."""
        return _CubicSpring(self.k3)


EFFECT = StiffeningSpring


@dataclass(frozen=True)
class _CubicSpring(Dynamics):
    k3: float

    def torque(self, theta: float, omega: float, own: list[float], above: bool) -> float:
        return -self.k3 * theta**3
