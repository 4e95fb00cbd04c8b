"""Damping that falls as motion warms the oil: a·(1 − share·w), where ẇ = (1 − w)·θ̇²/work and w starts at 0."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from synth.effects.effect import Dynamics, Effect, StateVariable
from synth.section import Positive, Share


class WarmingDamping(Effect):
    """Viscous damping that depends on the motion so far."""

    id: ClassVar[str] = "warming_damping"
    order: ClassVar[int] = 220
    states: ClassVar[tuple[StateVariable, ...]] = (StateVariable("warm_share", "1"),)
    keeps_places: ClassVar[bool] = True

    share: Share
    """Share of the damping that is lost when all oil is warm."""
    work: Positive
    """∫θ̇² dt after which 1/e of the oil is still cold, rad²/s."""

    def dynamics(self) -> Dynamics:
        """Return the warming oil."""
        return _Oil(self.share, self.work)


EFFECT = WarmingDamping


@dataclass(frozen=True)
class _Oil(Dynamics):
    share: float
    work: float
    """rad²/s."""

    def damping_factor(self, own: list[float]) -> float:
        return 1 - self.share * own[0]

    def rates(self, omega: float, acceleration: float, own: list[float]) -> list[float]:
        return [(1 - own[0]) * omega * omega / self.work]
