"""Perspective: a near camera whose axis meets the middle of the picture, at a slant to the plane of motion.

Without this effect the camera has a shifted lens, whose axis meets the shaft (`synth.camera`).
"""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from synth.effects.effect import Effect
from synth.section import Finite


class Perspective(Effect):
    """The direction from which an ordinary camera looks; its distance is ``camera.distance_m``."""

    id: ClassVar[str] = "perspective"
    order: ClassVar[int] = 135

    yaw_deg: Annotated[float, Field(gt=-60, lt=60, allow_inf_nan=False)]
    axis_deg: Finite = 90.0
    """Direction in the picture of the axis about which the camera is turned: 0 looks from above, 90 from the side."""


EFFECT = Perspective
