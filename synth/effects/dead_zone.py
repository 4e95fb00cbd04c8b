"""Dead zone: the servo ignores small position errors, c·dz(u − (b/c)·θ) for c·u − b·θ (`synth.motion.servo`)."""

from __future__ import annotations

from typing import ClassVar

from synth.effects.effect import Effect
from synth.section import Positive


class DeadZone(Effect):
    """Position errors below the half width have no effect."""

    id: ClassVar[str] = "dead_zone"
    order: ClassVar[int] = 60
    linear_plant_only: ClassVar[bool] = True

    half_width_deg: Positive


EFFECT = DeadZone
