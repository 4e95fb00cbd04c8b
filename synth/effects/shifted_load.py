"""A load that shifts at an instant, as something that falls off the head: from then on a constant torque acts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from synth.effects.effect import Dynamics, Effect
from synth.section import Finite, Positive


class ShiftedLoad(Effect):
    """A torque that begins within the recording."""

    id: ClassVar[str] = "shifted_load"
    order: ClassVar[int] = 250

    torque: Finite
    """rad/s²."""
    at_s: Positive

    def dynamics(self) -> Dynamics:
        """Return the torque."""
        return _Shifted(self.torque, self.at_s)


EFFECT = ShiftedLoad


@dataclass(frozen=True)
class _Shifted(Dynamics):
    level: float
    at: float

    def disturbance(self, t: float) -> float:
        return self.level if t >= self.at else 0.0
