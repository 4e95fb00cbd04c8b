"""Backlash: play between command and load, whose side moves only in contact with one flank or the other."""

from __future__ import annotations

import itertools
import math
from typing import ClassVar

import numpy as np

from synth.effects.effect import Effect
from synth.effects.piecewise import PiecewiseLinear
from synth.section import Positive


class Backlash(Effect):
    """Play of the command."""

    id: ClassVar[str] = "backlash"
    order: ClassVar[int] = 50

    half_width_deg: Positive

    def follow(self, command: PiecewiseLinear) -> PiecewiseLinear:
        """Apply the play operator."""
        return play(command, math.radians(self.half_width_deg))


EFFECT = Backlash


def play(leader: PiecewiseLinear, half_width: float) -> PiecewiseLinear:
    """Return the follower of a leader with play `half_width`, rad: it rests until a flank touches and pushes it.

    The follower begins in the middle of the play. Between two knots the leader moves one way, so there is at most one
    contact. Its instant is when the gap, which closes at a constant rate, has closed (the play operator of
    Krasnosel'skii and Pokrovskii, Systems with Hysteresis, 1989).
    """
    out: list[tuple[float, float, float]] = []
    at = 0.0
    ends = [*itertools.islice(leader.knots, 1, None), math.inf]
    for knot, following, level, slope in zip(leader.knots, ends, leader.levels, leader.slopes, strict=True):
        at = min(max(at, level - half_width), level + half_width)  # a jump pushes the follower at once
        if slope == 0.0:
            out.append((knot, at, 0.0))
            continue
        flank = math.copysign(half_width, slope)
        contact = knot + (at + flank - level) / slope
        if contact > knot:
            out.append((knot, at, 0.0))
        if contact < following:
            out.append((max(contact, knot), at, slope))
            at = level + slope * (following - knot) - flank
    return PiecewiseLinear(*np.array(out).T)
