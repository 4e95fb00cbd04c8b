"""Angle drift: the camera turns slowly about its line of sight, so that the measured angle creeps (`synth.shake`)."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from synth.effects.effect import Effect


class AngleDrift(Effect):
    """Rate of the camera's turn."""

    id: ClassVar[str] = "angle_drift"
    order: ClassVar[int] = 180

    rate_deg_per_s: Annotated[float, Field(ge=-5, le=5, allow_inf_nan=False)]


EFFECT = AngleDrift
