"""A first-order lag between command and torque, τ·v̇ = u − v; `PiecewiseLinear.lagged` solves it in closed form."""

from __future__ import annotations

from typing import ClassVar

from synth.effects.effect import Effect
from synth.section import Positive


class ActuatorLag(Effect):
    """First-order lag of the command."""

    id: ClassVar[str] = "actuator_lag"
    order: ClassVar[int] = 20

    tau_s: Positive


EFFECT = ActuatorLag
