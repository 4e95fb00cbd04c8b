"""Dry friction in the bearings: it holds a resting head and opposes a sliding one, and there is nothing in between.

    θ̈ = p − F(θ̇)·sgn θ̇      while sliding; p is the pull of everything else
    θ̇ = 0                   while −B₋ ≤ p ≤ B₊: the head sticks
    F(θ̇) = F± + (B± − F±)·exp(−(θ̇/ω_s)²)

F± upwards and downwards, B± to break away. The last line is Stribeck's curve, which joins breakaway and sliding
(Armstrong-Hélouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994); without a speed ω_s friction falls at once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from synth.spec import CoulombFriction


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

    def sliding(self, sense: int, omega: float) -> float:
        """Oppose a motion of this sense, +1 or −1, and this speed, rad/s, by an angular acceleration, rad/s²."""
        level = self.upward if sense > 0 else self.downward
        if self.stribeck is not None:
            level += (self.breakaway(sense) - level) * math.exp(-((omega / self.stribeck) ** 2))
        return -sense * level

    def breakaway(self, sense: int) -> float:
        """Pull that it takes to leave rest in a sense, rad/s²."""
        return self.leave_upward if sense > 0 else self.leave_downward

    def sense(self, pull: float) -> int:
        """Which way a pull moves a resting head: +1, −1, or 0 where it sticks."""
        return 1 if pull > self.leave_upward else -1 if pull < -self.leave_downward else 0


def build_friction(effect: CoulombFriction) -> Friction:
    """Take the numbers of the spec, each with its default."""
    downward = effect.torque if effect.downward is None else effect.downward
    leave = effect.breakaway
    return Friction(
        upward=effect.torque,
        downward=downward,
        leave_upward=effect.torque if leave is None else leave,
        leave_downward=downward if leave is None else leave,
        stribeck=None if effect.stribeck_deg_per_s is None else math.radians(effect.stribeck_deg_per_s),
    )
