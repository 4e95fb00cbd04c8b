"""The one compiled integrator, with every effect of the ledger at its port and at its null unless given.

    θ̈ = c·u − a·θ̇ − b·θ + Σ load_i(θ, θ̇, u) − dry friction

Classical fourth-order Runge-Kutta between *stops*: frames and command switches. Because every switch is a stop, a
delay is exact and the prediction is differentiable in it. Dry friction is set-valued at rest, so the instant at
which a velocity reaches zero is located inside the step and the head then sticks until the torque on it exceeds
the break-away level (Karnopp, J. Dyn. Syst. Meas. Control 107, 1985).
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from anglecam.effects import LEDGER

Floats = NDArray[np.float64]

LOAD_IDS = tuple(e.id for e in LEDGER if e.load is not None)
DRY_IDS = tuple(e.id for e in LEDGER if e.dry is not None)
WIDTH = max(len(e.parameters) for e in LEDGER)
"""Parameters an effect may have: the rows of the integrator's parameter tables are this long."""


def _sum_of_loads(loads, row=0):  # type: ignore[no-untyped-def]  # compiled
    """Compile the sum of all load functions, each with its row of the parameter table, into one function."""
    if row == len(loads):
        return njit(lambda theta, omega, u, table: 0.0)
    first, others = loads[row], _sum_of_loads(loads, row + 1)
    return njit(lambda theta, omega, u, table: first(theta, omega, u, table[row]) + others(theta, omega, u, table))


def _sum_of_dries(dries, row=0):  # type: ignore[no-untyped-def]  # compiled
    """Compile the sums of the sliding and the break-away levels into one function."""
    if row == len(dries):
        return njit(lambda table: (0.0, 0.0))
    first, others = dries[row], _sum_of_dries(dries, row + 1)

    @njit
    def total(table):  # type: ignore[no-untyped-def]
        sliding, breakaway = first(table[row])
        more_sliding, more_breakaway = others(table)
        return sliding + more_sliding, breakaway + more_breakaway

    return total


_load = _sum_of_loads([e.load for e in LEDGER if e.load is not None])
_friction = _sum_of_dries([e.dry for e in LEDGER if e.dry is not None])


@njit
def _smooth(theta, omega, u, abc, loads):  # type: ignore[no-untyped-def]  # compiled
    return abc[2] * u - abc[0] * omega - abc[1] * theta + _load(theta, omega, u, loads)


@njit
def _step(theta, omega, u, h, abc, loads, opposing):  # type: ignore[no-untyped-def]  # compiled
    k1 = _smooth(theta, omega, u, abc, loads) - opposing
    v2 = omega + 0.5 * h * k1
    k2 = _smooth(theta + 0.5 * h * omega, v2, u, abc, loads) - opposing
    v3 = omega + 0.5 * h * k2
    k3 = _smooth(theta + 0.5 * h * v2, v3, u, abc, loads) - opposing
    v4 = omega + h * k3
    k4 = _smooth(theta + h * v3, v4, u, abc, loads) - opposing
    return theta + h * (omega + 2.0 * v2 + 2.0 * v3 + v4) / 6.0, omega + h * (k1 + 2.0 * k2 + 2.0 * k3 + k4) / 6.0


@njit
def _advance(theta, omega, u, h, abc, loads, sliding, breakaway):  # type: ignore[no-untyped-def]  # compiled
    """Advance by ``h`` under a constant command, through any number of standstills."""
    left = h
    while left > 0.0:
        if omega == 0.0:
            torque = _smooth(theta, 0.0, u, abc, loads)
            if abs(torque) <= breakaway:
                return theta, 0.0
            direction = np.sign(torque)
        else:
            direction = np.sign(omega)
        opposing = direction * sliding
        new_theta, new_omega = _step(theta, omega, u, left, abc, loads, opposing)
        if sliding == 0.0 or new_omega * direction >= 0.0:
            return new_theta, new_omega
        # false position (Illinois) on the step length at which the velocity vanishes
        low, high, f_low, f_high = 0.0, left, omega, new_omega
        if omega == 0.0:  # set off and turned back within one step: look for the turn after the start
            low = 1e-3 * left
            f_low = _step(theta, omega, u, low, abc, loads, opposing)[1]
            if f_low * direction <= 0.0:
                return theta, 0.0
        middle = high
        for _ in range(30):
            middle = (low * f_high - high * f_low) / (f_high - f_low)
            new_theta, new_omega = _step(theta, omega, u, middle, abc, loads, opposing)
            if abs(new_omega) < 1e-12 or high - low < 1e-12:
                break
            if new_omega * direction > 0.0:
                low, f_low = middle, new_omega
                f_high *= 0.5
            else:
                high, f_high = middle, new_omega
                f_low *= 0.5
        theta, omega = new_theta, 0.0
        left -= max(middle, 1e-9)
    return theta, omega


@njit
def integrate(time, theta, omega, switches, values, abc, loads, dries, max_step):  # type: ignore[no-untyped-def]
    """Return angle and rate at ``time``; compiled, so all arguments are taken as they come.

    Parameters
    ----------
    time : (n,) ndarray
        Increasing instants, s; the state is given at the first of them.
    theta, omega : float
        Angle from equilibrium at zero command (rad) and its rate (rad/s) at ``time[0]``.
    switches, values : (m,) ndarray
        Piecewise constant command: instants (s) and values (rad); before the first the first value holds.
    abc : (3,) ndarray
        a (1/s), b (1/s²), c (1/s²) of Eq. (30).
    loads, dries : (k, WIDTH) ndarray
        Parameters of the effects at the two ports, a row each in the order of `LOAD_IDS` and `DRY_IDS`.
    max_step : float
        Longest step, s.

    Returns
    -------
    (n, 2) ndarray
        Angle, rad, and rate, rad/s.
    """
    n, m = len(time), len(switches)
    states = np.empty((n, 2))
    states[0] = theta, omega
    sliding, breakaway = _friction(dries)
    k = 0
    while k + 1 < m and switches[k + 1] <= time[0]:
        k += 1
    now = time[0]
    for i in range(1, n):
        while now < time[i]:
            stop = time[i]
            if k + 1 < m and switches[k + 1] < stop:
                stop = switches[k + 1]
            steps = max(1, int(np.ceil((stop - now) / max_step)))
            h = (stop - now) / steps
            for _ in range(steps):
                theta, omega = _advance(theta, omega, values[k], h, abc, loads, sliding, breakaway)
            now = stop
            while k + 1 < m and switches[k + 1] <= now:
                k += 1
        states[i] = theta, omega
    return states
