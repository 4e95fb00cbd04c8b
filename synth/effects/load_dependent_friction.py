"""Load-dependent friction: dry friction that is a share of the torque of the servo (`synth.motion.servo`).

The servo's torque is c·v − (1 − spring_share)·b·θ; springs on the head supply the rest of b. Friction is share times
its magnitude, both to slide and to break away, in addition to that of `coulomb_friction`.
"""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from synth.effects.effect import Effect
from synth.section import Share


class LoadDependentFriction(Effect):
    """Friction of gears and bearings under load."""

    id: ClassVar[str] = "load_dependent_friction"
    order: ClassVar[int] = 75
    linear_plant_only: ClassVar[bool] = True

    share: Annotated[float, Field(ge=0, lt=1, allow_inf_nan=False)]
    """Friction over the transmitted torque."""
    spring_share: Share = 0.0
    """Share of b that springs on the head supply."""


EFFECT = LoadDependentFriction
