"""Rate limit: the effective command moves no faster than the servo can follow.

    |v̇| ≤ r;   v moves towards u at the rate r until it reaches u

The paper's amplifier gives any voltage at any speed, Eq. (6); Fig. 12 shows 6 V sagging to 3.5 V.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from anglecam.data.typing import Floats
from anglecam.effects.effect import Effect, Knots, Parameter


def _limit(given: Knots, parameters: Floats) -> Knots:
    """Follow a piecewise constant command by ramps; any other command is sampled at its knots."""
    return given if parameters[0] <= 0.0 else Knots(*_follow(given.time, given.level, 1.0 / parameters[0]))


@njit("(float64[::1], float64[::1], float64)", nogil=True, cache=True)
def _follow(time: Floats, level: Floats, rate: float) -> tuple[Floats, Floats, Floats]:
    knots = np.zeros((3, 2 * len(time)))
    n, at = 0, level[0]
    for i in range(len(time)):
        until = time[i + 1] if i + 1 < len(time) else np.inf
        way = level[i] - at
        arrival = time[i] + abs(way) / rate
        if way != 0.0:
            knots[0, n], knots[1, n], knots[2, n] = time[i], at, np.copysign(rate, way)
            n += 1
        if arrival < until:
            knots[0, n], knots[1, n] = arrival, level[i]
            n += 1
            at = level[i]
        else:
            at += np.copysign(rate, way) * (until - time[i])
    return knots[0, :n], knots[1, :n], knots[2, :n]


EFFECT = Effect(
    id="rate_limit",
    station="command",
    summary="The servo turns no faster than a fixed number of degrees a second, however large the command.",
    equation="|v̇| ≤ r in θ̈ = c·v − a·θ̇ − b·θ",
    relaxes="Eq. (6): the amplifier gives any voltage at any speed",
    parameters=(
        Parameter(
            "rate_deg_per_s", "r", 0.0, 0.0, 20.0, (0.02, 0.1, 0.5), math.degrees(1.0), inverse=True, swing_power=1
        ),
    ),
    aliases=("torque_saturation", "actuator_lag"),
    separating_experiment="steps of two heights, one at least three times the other: a limit slows only the larger",
    source="the paper, Fig. 12; HS-225MG data sheet: 0.11 s for 60°",
    rank=1,
    command=_limit,
)
