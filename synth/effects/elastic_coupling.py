"""An elastic coupling: something flexible on the head that swings, such as an antenna, and shakes the head in turn.

Its angle ψ is measured from the head. It turns about the head's axis of rotation, held to the head by a spring and a
damper. With I its inertia and J the head's,

    I·(θ̈ + ψ̈) = −k·ψ − d·ψ̇        and the head gets the opposite torque, so with s = I/J, ω² = k/I, 2ζω = d/I
    ψ̈ = −ω²·ψ − 2ζω·ψ̇ − θ̈          head: + s·(ω²·ψ + 2ζω·ψ̇)
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

from pydantic import Field

from synth.effects.effect import Dynamics, Effect, StateVariable
from synth.section import NotNegative, Positive


class ElasticCoupling(Effect):
    """An oscillator on the head."""

    id: ClassVar[str] = "elastic_coupling"
    order: ClassVar[int] = 200
    states: ClassVar[tuple[StateVariable, ...]] = (
        StateVariable("psi", "rad"),
        StateVariable("psi_rate", "rad/s", is_speed=True),
    )
    keeps_places: ClassVar[bool] = True

    frequency_hz: Positive
    """Natural frequency of the appendage with the head held."""
    damping_ratio: NotNegative = 0.02
    inertia_share: Annotated[float, Field(gt=0, lt=1, allow_inf_nan=False)] = 0.1
    """Ratio of its inertia to the head's."""

    def dynamics(self) -> Dynamics:
        """Return the oscillator."""
        rate = 2 * math.pi * self.frequency_hz
        return _Oscillator(rate**2, 2 * self.damping_ratio * rate, self.inertia_share)


EFFECT = ElasticCoupling


@dataclass(frozen=True)
class _Oscillator(Dynamics):
    stiffness: float
    """k/I, 1/s²."""
    damping: float
    """d/I, 1/s."""
    share: float
    """I/J."""

    def torque(self, theta: float, omega: float, own: list[float], above: bool) -> float:
        psi, swing = own
        return self.share * (self.stiffness * psi + self.damping * swing)

    def rates(self, omega: float, acceleration: float, own: list[float]) -> list[float]:
        psi, swing = own
        return [swing, -self.stiffness * psi - self.damping * swing - acceleration]
