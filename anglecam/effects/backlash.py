"""Backlash: play between command and load. Contact with one flank or the other moves the load.

    v = P_w[u]: |u − v| ≤ w, and v moves only where u pushes it      (play operator of half-width w)

The paper takes gears and joints for exact. Its bearings accept 5° of misalignment, and its linkage has four joints.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from anglecam.data.typing import Floats
from anglecam.effects.effect import Effect, Knots, Parameter


def _play(given: Knots, parameters: Floats) -> Knots:
    """Follow the command with play, starting in the middle of it; the instants of contact are exact."""
    width = parameters[0]
    return given if width <= 0.0 else Knots(*_follow(given.time, given.level, given.slope, width))


@njit("(float64[::1], float64[::1], float64[::1], float64)", nogil=True, cache=True)
def _follow(time: Floats, level: Floats, slope: Floats, width: float) -> tuple[Floats, Floats, Floats]:
    knots = np.zeros((3, 2 * len(time)))
    n, at = 0, level[0]
    for i in range(len(time)):
        at = min(max(at, level[i] - width), level[i] + width)
        knots[0, n], knots[1, n] = time[i], at
        n += 1
        if slope[i] == 0.0:
            continue
        until = time[i + 1] if i + 1 < len(time) else np.inf
        touch = max(time[i] + (at - level[i] + np.copysign(width, slope[i])) / slope[i], time[i])
        if touch < until:
            knots[0, n], knots[1, n], knots[2, n] = touch, at, slope[i]
            n += 1
            at += slope[i] * (until - touch) if np.isfinite(until) else 0.0
    return knots[0, :n], knots[1, :n], knots[2, :n]


EFFECT = Effect(
    id="backlash",
    station="actuator",
    summary="There is play between servo and body, so that the body lags behind whenever the command reverses.",
    equation="θ̈ = c·P_w[u] − a·θ̇ − b·θ with the play operator P_w",
    relaxes="Eqs. (3), (9): gears and joints are exact",
    parameters=(
        Parameter(
            "half_width_deg", "w", 0.0, 0.0, math.radians(15.0), (0.003, 0.01, 0.03), math.degrees(1.0), swing_power=1
        ),
    ),
    aliases=("dead_zone", "coulomb_friction"),
    separating_experiment=(
        "a slow triangle, then steps up only and steps down only to the same levels: with play the body rests at two"
        " angles for one command, depending on the direction it came from"
    ),
    source="Nordin, Gutman, Automatica 38(10), 2002",
    rank=2,
    command=_play,
)
