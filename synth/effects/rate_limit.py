"""Rate limit: the effective command moves no faster than a given rate."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from synth.effects.effect import Effect
from synth.effects.piecewise import PiecewiseLinear
from synth.section import Positive


class RateLimit(Effect):
    """Limit of the command's rate."""

    id: ClassVar[str] = "rate_limit"
    order: ClassVar[int] = 30

    r_deg_per_s: Positive

    def follow(self, command: PiecewiseLinear) -> PiecewiseLinear:
        """Turn the steps of a staircase into ramps."""
        return ramps(command, math.radians(self.r_deg_per_s))


EFFECT = RateLimit


def ramps(stairs: PiecewiseLinear, rate: float) -> PiecewiseLinear:
    """Return what follows a staircase no faster than `rate`, rad/s."""
    out: list[tuple[float, float, float]] = []
    at = 0.0
    for knot, following, level in zip(stairs.knots, [*stairs.knots[1:], math.inf], stairs.levels, strict=True):
        takes = abs(level - at) / rate
        if takes > 0:
            slope = math.copysign(rate, level - at)
            out.append((knot, at, slope))
            if knot + takes >= following:
                at += slope * (following - knot)
                continue
        at = float(level)
        out.append((knot + takes, at, 0.0))
    return PiecewiseLinear(*np.array(out).T)
