"""Pivot offset: the pivot's mark is painted on the bearing, away from the axis of rotation (`synth.take`)."""

from __future__ import annotations

from typing import ClassVar

from synth.effects.effect import Effect
from synth.section import Finite


class PivotOffset(Effect):
    """Place of the painted mark relative to the axis of rotation."""

    id: ClassVar[str] = "pivot_offset"
    order: ClassVar[int] = 140

    dx_px: Finite
    dy_px: Finite


EFFECT = PivotOffset
