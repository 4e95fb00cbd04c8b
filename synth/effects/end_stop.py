"""End stops: stiff springs beyond an angle above, below or both, that take energy from the impact.

With the penetration δ the stop pushes back with stiffness·δ·(1 + dissipation·δ̇), never pulling (Hunt and Crossley,
J. Appl. Mech. 42, 1975).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from pydantic import model_validator

from synth.effects.effect import Dynamics, Effect
from synth.section import Finite, NotNegative, Positive


class EndStop(Effect):
    """Stops at the ends of the head's range."""

    id: ClassVar[str] = "end_stop"
    order: ClassVar[int] = 195

    stiffness: Positive
    """1/s²."""
    upper_deg: Finite | None = None
    lower_deg: Finite | None = None
    dissipation: NotNegative = 0.0
    """s/rad."""

    @model_validator(mode="after")
    def _stands_somewhere(self) -> EndStop:
        if self.upper_deg is None and self.lower_deg is None:
            raise ValueError("end_stop needs upper_deg or lower_deg")
        if self.upper_deg is not None and self.lower_deg is not None and self.lower_deg >= self.upper_deg:
            raise ValueError("lower_deg must be below upper_deg")
        return self

    def dynamics(self) -> Dynamics:
        """Return the stops."""
        upper = math.inf if self.upper_deg is None else math.radians(self.upper_deg)
        lower = -math.inf if self.lower_deg is None else math.radians(self.lower_deg)
        return _Stops(self.stiffness, upper, lower, self.dissipation)


EFFECT = EndStop


@dataclass(frozen=True)
class _Stops(Dynamics):
    stiffness: float
    upper: float
    lower: float
    dissipation: float

    has_edge = True

    def torque(self, theta: float, omega: float, own: list[float], above: bool) -> float:
        if not above:
            return 0.0
        over, side = (
            (theta - self.upper, 1.0) if theta - self.upper > self.lower - theta else (self.lower - theta, -1.0)
        )
        return -side * self.stiffness * over * max(1.0 + self.dissipation * side * omega, 0.0)

    def edge(self, theta: float) -> float:
        return max(theta - self.upper, self.lower - theta)
