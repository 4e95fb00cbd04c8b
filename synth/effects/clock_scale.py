"""Clock scale: the clip's clock runs fast (`synth.clock`)."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from synth.effects.effect import Effect


class ClockScale(Effect):
    """Seconds of the clip's clock for each true second."""

    id: ClassVar[str] = "clock_scale"
    order: ClassVar[int] = 170

    scale: Annotated[float, Field(gt=0.5, lt=2, allow_inf_nan=False)]


EFFECT = ClockScale
