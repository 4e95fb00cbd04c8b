"""The compiled integrator of the equation of motion, with any effects at their ports.

    θ̈ = servo(c·v − b·θ) − a·θ̇ + Σ load_i + Σ dynamics_i − dry friction,     τ·v̇ = u − v

It advances from *stop* to *stop*: frames and knots of the command. Between two stops the command is a straight line,
and the lag behind it is solved in closed form. Because every knot is a stop, a delay is exact and the prediction is
differentiable with respect to it. Without an effect inside the equation of motion a stretch between stops is a Taylor
series, exact to rounding (`anglecam.models.linear_step`); otherwise it is Runge-Kutta steps
(`anglecam.models.stepping`).

The effects arrive as addresses of compiled functions (`anglecam.models.pieces`), so that this file is compiled once.
"""

from __future__ import annotations

import numpy as np
from numba import njit, types

from anglecam.effects.ports import pointer_to, shifted
from anglecam.models.array_types import MATRIX, READ_COUNTS, READ_MATRIX, READ_TABLE, READ_VECTOR
from anglecam.models.drive import drive_at, line_at
from anglecam.models.linear_step import SETTLED, advance_linear
from anglecam.models.pieces import any_friction, settle
from anglecam.models.stepping import advance

FADED = 12.0
"""Time constants after which 6e-6 of a lag's transient is left."""


@njit
def _run(out, time, first, knots, lag, plant, max_step, near, extra):  # type: ignore[no-untyped-def]
    """Write one run's angle and rate to ``out``, (n, 2)."""
    n, m = len(time), knots.shape[1]
    abc = (plant[0][0], plant[0][1], plant[0][2])
    theta, omega = first[0], first[1]
    out[0] = first
    now = time[0]
    k = np.searchsorted(knots[0], now, side="right") - 1
    v, _ = line_at(knots, k, now)
    settle(theta, omega, v, plant, extra[0], extra[2])
    merges = len(near) == n and extra[2] == 0
    for i in range(1, n):
        while now < time[i]:
            stop = time[i]
            if k + 1 < m and knots[0, k + 1] < stop:
                stop = knots[0, k + 1]
            level, slope = line_at(knots, k, now)
            segment = (level, slope, v - level + slope * lag)
            if max_step == 0.0:
                theta, omega = advance_linear(theta, omega, stop - now, segment, lag, abc)
            else:
                # a short lag decays within a step: meanwhile steps are no longer than half of the lag
                fading = min(FADED * lag, stop - now) if abs(segment[2]) > SETTLED else 0.0
                for leg in range(2):
                    begin, end = (0.0, fading) if leg == 0 else (fading, stop - now)
                    longest = min(max_step, 0.5 * lag) if leg == 0 else max_step
                    steps = int(np.ceil((end - begin) / longest)) if end > begin else 0
                    for step in range(steps):
                        h = (end - begin) / steps
                        theta, omega = advance(theta, omega, (now, begin + step * h), h, (segment, lag), plant, extra)
            v = drive_at(stop - now, segment, lag)
            now = stop
            while k + 1 < m and knots[0, k + 1] <= now:
                k += 1
        out[i] = theta, omega
        if merges and theta == near[i, 0] and omega == near[i, 1]:
            out[i + 1 :] = near[i + 1 :]
            break


_SIGNATURE = MATRIX(
    *(READ_VECTOR, READ_COUNTS, READ_MATRIX, READ_MATRIX, READ_TABLE, types.float64, READ_VECTOR),
    *(READ_TABLE, READ_COUNTS, READ_VECTOR, MATRIX, types.float64, READ_MATRIX),
)


@njit(_SIGNATURE, nogil=True, cache=True)
def integrate(time, edges, first, knots, spans, lag, abc, table, ports, numbers, memory, max_step, near):  # type: ignore[no-untyped-def]
    """Return angle and rate at ``time`` in one or several runs; compiled, so the arguments are not checked.

    Parameters
    ----------
    time : (n,) ndarray
        Instants of all runs, s, increasing in each; the state is given at the first of each, where a lag and the
        effects' states have settled.
    edges : (r + 1,) ndarray of int
        Where each run begins in ``time``, and the end.
    first : (r, 2) ndarray
        Angle from equilibrium at zero command (rad) and its rate (rad/s) at the first instant of each run.
    knots : (3, m) ndarray
        Commands: instants (s), levels (rad) and slopes (rad/s); before its first knot a command's level holds.
    spans : (r, 2) ndarray of int
        First knot of each run's command, and the end.
    lag : float
        τ, s.
    abc : (3,) ndarray
        a (1/s), b (1/s²), c (1/s²) of Eq. (30).
    table, ports, numbers
        Effects inside the equation of motion: `table` and `edges` of `anglecam.models.pieces.Pieces`, and their
        parameters.
    memory : (1 + SCRATCH_ROWS, k) ndarray
        For the effects' k additional states; what it holds does not matter.
    max_step : float
        Longest Runge-Kutta step, s; 0 if no effect is inside the equation of motion.
    near : (n, 2) or (0, 2) ndarray
        Result with the same arguments from other states at the first instants, if it is known. A run that reaches
        the same state has forgotten where it started; the rest is copied.

    Returns
    -------
    (n, 2) ndarray
        Angle, rad, and rate, rad/s.
    """
    begins, rubs = (ports[0], ports[1], ports[2], ports[3], ports[4]), any_friction(table, ports, numbers)
    plant = (pointer_to(abc), pointer_to(table), begins, pointer_to(numbers), rubs)
    count = memory.shape[1]
    extra = (pointer_to(memory), shifted(pointer_to(memory), count), count)
    result = np.empty((len(time), 2))
    for i in range(len(first)):
        part, command = slice(edges[i], edges[i + 1]), knots[:, spans[i, 0] : spans[i, 1]]
        _run(result[part], time[part], first[i], command, lag, plant, max_step, near[part], extra)
    return result
