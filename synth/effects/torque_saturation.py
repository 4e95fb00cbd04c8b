"""Torque saturation: the servo's part of the torque, c·u − share·b·θ, stays within ±limit (`synth.motion.servo`)."""

from __future__ import annotations

from typing import ClassVar

from synth.effects.effect import Effect
from synth.section import Positive, Share


class TorqueSaturation(Effect):
    """Limit of the servo's torque."""

    id: ClassVar[str] = "torque_saturation"
    order: ClassVar[int] = 40

    limit: Positive
    """rad/s²."""
    share: Share = 1.0
    """Share of b that is the servo's position feedback; ignored by a neck, whose servo has separate feedback."""


EFFECT = TorqueSaturation
