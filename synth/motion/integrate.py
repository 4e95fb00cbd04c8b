"""Integrates a system from kink to kink, with Dormand and Prince's eighth-order method within each smooth piece.

Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., 1993, sec. II.5-II.6: steps of order 8 with
an interpolant of order 7. scipy's event loop checks only the ends of a step and cannot change the right-hand side, so
the steps are taken here. Each step is searched for the first end of its mode, which is located on the interpolant to
the last digit of the time.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DOP853, DenseOutput, OdeSolution
from scipy.optimize import brentq

from synth.effects import PiecewiseLinear
from synth.motion.system import Mode, Signal, State, System

Floats = NDArray[np.float64]

LONGEST_STEP_S = 0.005
"""Longest step, s: keeps the interpolant as accurate as the steps, and steps over no reversal of the head."""
CHECKS = 3
"""Number of times within a step at which the end of its mode is checked for."""
AT_THE_EDGE = 1e-3
"""A step that fails this close to the end of the reach is attributed to the end of the reach, rad."""


def integrate(
    system: System, drive: PiecewiseLinear, lag: float, start_angle: float, begin: float, end: float
) -> Callable[[Floats], Floats]:
    """Integrate the motion from rest.

    Parameters
    ----------
    system : System
        Plant and effects.
    drive : PiecewiseLinear
        The command as it reaches the load, rad.
    lag : float
        τ of the lag between command and torque, s; 0 without a lag.
    start_angle : float
        θ at rest, rad.
    begin, end : float
        s.

    Returns
    -------
    callable
        Times of shape (n,), s, between `begin` and `end` → states of shape (m, n).

    Raises
    ------
    ValueError
        If the head leaves the range in which the linkage closes, or runs away.
    """
    ends, interpolants = [begin], []
    state: State = [start_angle] + [0.0] * (system.count - 1)
    v, sense, step = 0.0, 1, LONGEST_STEP_S / 10
    inside = drive.knots[(drive.knots > begin) & (drive.knots < end)]
    for start, until in itertools.pairwise([begin, *inside.tolist(), end]):
        arriving = drive.lagged(lag, start, v)
        mode, now = system.mode(start, state, arriving, sense), start
        while now < until:
            rates = system.rates(mode, arriving)
            solver = DOP853(
                lambda t, x, rates=rates: rates(t, x.tolist()),
                now,
                state,
                until,
                first_step=min(step, until - now),
                max_step=LONGEST_STEP_S,
                rtol=1e-10,
                atol=1e-12,
            )
            over: float | None = None
            while over is None and solver.status == "running":
                solver.step()
                if solver.status == "failed":
                    raise ValueError(_why(system, solver.t, float(solver.y[0])))
                step = solver.step_size
                way = solver.dense_output()
                over = _first_end(system, mode, arriving, way, solver.t_old, solver.t) if system.kinked else None
                now = float(solver.t) if over is None else over
                if now > ends[-1]:
                    ends.append(now)
                    interpolants.append(way)
            state = solver.y.tolist()
            if over is not None:
                state = way(over).tolist()
                margins = system.margins(over, state, mode, arriving)
                mode, state = system.beyond(int(np.argmin(margins)), over, state, mode, arriving)
        v, sense = arriving(until), mode.sense
    return OdeSolution(ends, interpolants)


def _first_end(system: System, mode: Mode, drive: Signal, way: DenseOutput, begin: float, end: float) -> float | None:
    """Return the first time within a step at which its mode ends; ``None`` if it does not end."""

    def margin(t: float) -> float:
        return min(system.margins(t, way(t).tolist(), mode, drive))

    checks = np.linspace(begin, end, CHECKS + 1)
    for before, after, state in zip(checks.tolist(), checks[1:].tolist(), way(checks[1:]).T.tolist(), strict=False):
        if min(system.margins(after, state, mode, drive)) < 0:
            if margin(before) <= 0:
                return before
            return float(brentq(margin, before, after, xtol=1e-15, rtol=1e-15))
    return None


def _why(system: System, time: float, angle: float) -> str:
    low, high = system.mechanism.reach
    if not low + AT_THE_EDGE < angle < high - AT_THE_EDGE:
        return f"the head would leave the range in which the linkage closes, at t = {time:.3f} s"
    if not math.isfinite(angle) or abs(angle) > math.tau:
        return f"the head runs away, at t = {time:.3f} s"
    return f"the motion cannot be integrated beyond t = {time:.3f} s"
