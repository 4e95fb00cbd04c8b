"""Linkage geometry: the four-bar's γ(θ) between servo and head in place of a constant (`synth.motion.mechanism`)."""

from __future__ import annotations

from typing import ClassVar

from synth.effects.effect import Effect
from synth.section import Share


class LinkageGeometry(Effect):
    """The exact four-bar between servo and head."""

    id: ClassVar[str] = "linkage_geometry"
    order: ClassVar[int] = 110
    linear_plant_only: ClassVar[bool] = True

    share: Share = 1.0
    """Share of b that acts through the linkage as the servo's position feedback."""


EFFECT = LinkageGeometry
