"""What the load is asked for: the command after controller, dead time, rate limit and play, exactly.

Each of them makes straight lines of straight lines, so the whole way has a closed form, and so has the lag behind it,
τ·v̇ = u − v.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from synth.motion.controller import send
from synth.spec import Spec

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Drive:
    """An angle made of straight lines: from each knot on, u = level + slope·(t − knot); zero before the first."""

    knots: Floats
    """s, ascending."""
    levels: Floats
    """rad."""
    slopes: Floats
    """rad/s."""

    def after(self, lag: float, begin: float, v: float) -> Callable[[float], float]:
        """v(t) between two knots, from `begin` on, where it has the value `v`; without lag it is u."""
        k = int(np.searchsorted(self.knots, begin, side="right")) - 1
        if k >= 0:
            knot, level, slope = float(self.knots[k]), float(self.levels[k]), float(self.slopes[k])
        else:
            knot, level, slope = begin, 0.0, 0.0
        if lag == 0.0:
            return lambda t: level + slope * (t - knot)
        behind = level + slope * (begin - knot) - slope * lag
        return lambda t: behind + slope * (t - begin) + (v - behind) * math.exp(-(t - begin) / lag)


def drive(rows: Floats | None, spec: Spec) -> Drive:
    """Follow a command from the file to the load.

    Parameters
    ----------
    rows : ndarray or None
        (time_s, command_deg), each held until the next; ``None`` for no command.
    spec : Spec
        Of which the controller, ``dead_time``, ``rate_limit`` and ``backlash`` act here, in this order.

    Returns
    -------
    Drive
        u(t), rad.
    """
    if rows is None:
        return Drive(np.zeros(1), np.zeros(1), np.zeros(1))
    effects = spec.effects
    knots, levels = send(rows[:, 0], np.radians(rows[:, 1]), spec.controller, spec.rig.linkage)
    knots = knots + (effects.dead_time.tau_s if effects.dead_time else 0.0)
    asked = Drive(knots, levels, np.zeros(len(knots)))
    if effects.rate_limit:
        asked = ramps(asked, math.radians(effects.rate_limit.r_deg_per_s))
    if effects.backlash:
        asked = play(asked, math.radians(effects.backlash.half_width_deg))
    return asked


def ramps(stairs: Drive, rate: float) -> Drive:
    """Follow a staircase no faster than `rate`, rad/s."""
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
    return Drive(*np.array(out).T)


def play(leader: Drive, half_width: float) -> Drive:
    """Follow with play: the follower rests until one flank or the other touches it, and then goes along.

    It begins in the middle of the play. Between two knots the leader goes one way, so there is one contact at most
    and its instant is that at which the gap, closing evenly, is used up (the play operator of Krasnosel'skii and
    Pokrovskii, Systems with Hysteresis, 1989).
    """
    out: list[tuple[float, float, float]] = []
    at = 0.0
    ends = [*itertools.islice(leader.knots, 1, None), math.inf]
    for knot, following, level, slope in zip(leader.knots, ends, leader.levels, leader.slopes, strict=True):
        at = min(max(at, level - half_width), level + half_width)  # a jump pushes it at once
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
    return Drive(*np.array(out).T)
