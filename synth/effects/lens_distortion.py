"""Radial lens distortion about the middle of the picture (`synth.camera`)."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from synth.effects.effect import Effect


class LensDistortion(Effect):
    """r becomes r·(1 + k1·r²), r in units of the focal length."""

    id: ClassVar[str] = "lens_distortion"
    order: ClassVar[int] = 150

    k1: Annotated[float, Field(ge=-1, le=1, allow_inf_nan=False)]


EFFECT = LensDistortion
