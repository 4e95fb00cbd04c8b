"""Dry friction in the bearings: it holds a resting head and opposes a sliding one, without a regime in between.

    θ̈ = p − F(θ̇)·sgn θ̇      while sliding; p is the sum of all other torques
    θ̇ = 0                   while −B₋ ≤ p ≤ B₊: the head sticks
    F(θ̇) = F± + (B± − F±)·exp(−(θ̇/ω_s)²)

F± is the sliding friction upwards and downwards, B± the breakaway friction. The last line is Stribeck's curve, which
joins breakaway and sliding (Armstrong-Hélouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994); without a speed ω_s
friction falls to its sliding value at once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from pydantic import model_validator

from synth.effects.effect import Effect
from synth.section import NotNegative, Positive


class CoulombFriction(Effect):
    """Dry friction."""

    id: ClassVar[str] = "coulomb_friction"
    order: ClassVar[int] = 70

    torque: NotNegative
    """While sliding upwards, and downwards too unless `downward` is given, rad/s²."""
    downward: NotNegative | None = None
    """While sliding downwards, rad/s²."""
    breakaway: NotNegative | None = None
    """To leave rest in either direction, rad/s²; the sliding friction where not given."""
    stribeck_deg_per_s: Positive | None = None
    """Speed ω_s within which friction falls from breakaway to sliding; it falls at once where not given."""

    @model_validator(mode="after")
    def _breakaway_holds_more(self) -> CoulombFriction:
        if self.breakaway is not None and self.breakaway < max(self.torque, self.downward or 0.0):
            raise ValueError("breakaway must not be smaller than torque")
        if self.stribeck_deg_per_s is not None and self.breakaway is None:
            raise ValueError("stribeck_deg_per_s needs a breakaway to fall from")
        return self


EFFECT = CoulombFriction


@dataclass(frozen=True)
class Friction:
    """Friction in both directions, rad/s²."""

    upward: float
    downward: float
    leave_upward: float
    """To break away upwards, B₊."""
    leave_downward: float
    stribeck: float | None
    """ω_s, rad/s."""
    share: float = 0.0
    """Share of the servo's torque that is added to every level (`load_dependent_friction`)."""

    def sliding(self, sense: int, omega: float, servo: float = 0.0) -> float:
        """Return the friction's angular acceleration, rad/s², against a motion of sense +1 or −1 and speed, rad/s.

        `servo` is the servo's torque, rad/s².
        """
        level = self.upward if sense > 0 else self.downward
        if self.stribeck is not None:
            leave = self.leave_upward if sense > 0 else self.leave_downward
            level += (leave - level) * math.exp(-((omega / self.stribeck) ** 2))
        return -sense * (level + self.share * abs(servo))

    def breakaway(self, sense: int, servo: float = 0.0) -> float:
        """Return the torque needed to leave rest in a sense, rad/s²."""
        return (self.leave_upward if sense > 0 else self.leave_downward) + self.share * abs(servo)

    def sense(self, torque: float, servo: float = 0.0) -> int:
        """Return the direction in which a torque moves a resting head: +1, −1, or 0 where it sticks."""
        return 1 if torque > self.breakaway(1, servo) else -1 if torque < -self.breakaway(-1, servo) else 0


def build_friction(effect: CoulombFriction | None, share: float = 0.0) -> Friction | None:
    """Return the friction of a spec's section, with its defaults filled in; ``None`` where nothing rubs.

    `share` is that of the servo's torque in `load_dependent_friction`.
    """
    if effect is None:
        return Friction(0.0, 0.0, 0.0, 0.0, None, share) if share > 0.0 else None
    downward = effect.torque if effect.downward is None else effect.downward
    leave = effect.breakaway
    return Friction(
        upward=effect.torque,
        downward=downward,
        leave_upward=effect.torque if leave is None else leave,
        leave_downward=downward if leave is None else leave,
        stribeck=None if effect.stribeck_deg_per_s is None else math.radians(effect.stribeck_deg_per_s),
        share=share,
    )
