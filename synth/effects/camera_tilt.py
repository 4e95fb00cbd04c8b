"""Camera tilt: the plane of motion is seen at a slant (`synth.camera`)."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from synth.effects.effect import Effect
from synth.section import Finite


class CameraTilt(Effect):
    """Angle between the optical axis and the axis of rotation."""

    id: ClassVar[str] = "camera_tilt"
    order: ClassVar[int] = 130

    tilt_deg: Annotated[float, Field(gt=-80, lt=80, allow_inf_nan=False)]
    axis_deg: Finite = 0.0
    """Direction in the picture of the axis about which the camera is turned: 0 looks from above, 90 from the side."""


EFFECT = CameraTilt
