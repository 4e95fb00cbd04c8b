"""Rolling shutter: each row is exposed later than the row above it (`synth.exposure`)."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from synth.effects.effect import Effect


class RollingShutter(Effect):
    """The middle row is exposed at the frame's time."""

    id: ClassVar[str] = "rolling_shutter"
    order: ClassVar[int] = 160

    row_time_s: Annotated[float, Field(ge=0, le=1e-3, allow_inf_nan=False)]


EFFECT = RollingShutter
