"""Damping that falls while the oil warms up: a·(1 − share·w), where ẇ = (1 − w)/time_s and w starts at 0."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

from pydantic import Field

from synth.effects.effect import Dynamics, Effect, StateVariable
from synth.section import Positive


class TimeVaryingParameter(Effect):
    """Viscous damping that depends on the time since the motion began."""

    id: ClassVar[str] = "time_varying_parameter"
    order: ClassVar[int] = 220
    states: ClassVar[tuple[StateVariable, ...]] = (StateVariable("warm_share", "1"),)
    keeps_places: ClassVar[bool] = True

    share: Annotated[float, Field(ge=-3, le=1, allow_inf_nan=False)]
    """Share of the damping that is lost when all oil is warm; negative where the damping grows."""
    time_s: Positive
    """Time after which 1/e of the oil is still cold."""

    def dynamics(self) -> Dynamics:
        """Return the warming oil."""
        return _Oil(self.share, self.time_s)


EFFECT = TimeVaryingParameter


@dataclass(frozen=True)
class _Oil(Dynamics):
    share: float
    time_s: float

    def damping_factor(self, own: list[float]) -> float:
        return 1 - self.share * own[0]

    def rates(self, omega: float, acceleration: float, own: list[float]) -> list[float]:
        return [(1 - own[0]) / self.time_s]
