"""A constant torque on the head."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from synth.effects.effect import Dynamics, Effect
from synth.section import Finite


class ConstantTorque(Effect):
    """A constant torque."""

    id: ClassVar[str] = "constant_torque"
    order: ClassVar[int] = 120

    torque: Finite
    """rad/s²."""

    def dynamics(self) -> Dynamics:
        """Return the torque."""
        return _Constant(self.torque)


EFFECT = ConstantTorque


@dataclass(frozen=True)
class _Constant(Dynamics):
    level: float

    def torque(self, theta: float, omega: float, own: list[float], above: bool) -> float:
        return self.level
