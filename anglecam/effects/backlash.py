"""Backlash: play between command and load; the load is moved by contact with one flank or the other.

    v follows u as a shaft follows a key that is 2·w narrower than its way

The paper's gears and joints are exact; its bearings take 5° of misalignment, and its linkage has four joints.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from anglecam.data.typing import Floats
from anglecam.effects.effect import Effect, Knots, Parameter


def _play(asked: Knots, parameters: Floats) -> Knots:
    """Follow with play, beginning in its middle; the instants of contact are exact."""
    width = parameters[0]
    return asked if width <= 0.0 else Knots(*_follow(asked.time, asked.level, asked.slope, width))


@njit(nogil=True)
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
    summary="Between servo and head there is play, so that the head stays behind whenever the command turns round.",
    equation="θ̈ = c·P_w[u] − a·θ̇ − b·θ with the play operator P_w",
    relaxes="Eqs. (3), (9): gears and joints are exact",
    parameters=(
        Parameter("half_width_deg", "w", 0.0, 0.0, math.radians(15.0), (0.003, 0.01, 0.03), math.degrees(1.0)),
    ),
    aliases=("dead_zone", "coulomb_friction"),
    separating_experiment=(
        "a slow triangle, then steps up only and steps down only to the same levels: with play the head stands at two"
        " places for one command, by the way it came"
    ),
    source="Nordin, Gutman, Automatica 38(10), 2002",
    rank=2,
    command=_play,
)
