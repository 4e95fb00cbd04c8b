"""Speed-dependent torque: the servo gives −stall·(1 + θ̇/ω0) to stall·(1 − θ̇/ω0) at most (`synth.motion.servo`).

ω0 is the speed at which a motor on its full voltage has no torque left. The head must stay slower than that.
"""

from __future__ import annotations

from typing import ClassVar

from synth.effects.effect import Effect
from synth.section import Positive


class SpeedDependentTorque(Effect):
    """The torque-speed line of a motor."""

    id: ClassVar[str] = "speed_dependent_torque"
    order: ClassVar[int] = 45

    stall: Positive
    """rad/s²."""
    no_load_deg_per_s: Positive


EFFECT = SpeedDependentTorque
