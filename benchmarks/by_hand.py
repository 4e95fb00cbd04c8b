"""Fits by hand: the equation of motion that an expert would write down, integrated and fitted without anglecam.

A free run is integrated by Runge and Kutta's method with steps of at most 0.25 ms. The command is held from one sample
to the next, or interpolated where it is a signal. Parameters and initial states are fitted together by SciPy.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.optimize import least_squares

Floats = NDArray[np.float64]
STEP_S = 2.5e-4
"""Longest step of the integration; friction that grows linearly up to `SLOW` is stiff."""
SLOW = 0.005
"""Speed below which dry friction grows linearly, rad/s or m/s: a sign would stop the integration's convergence. At ten
times this speed a servo that holds a weight creeps, and its fit ends in another minimum."""


@dataclass(frozen=True)
class Series:
    """One recording."""

    time: Floats
    value: Floats
    command: Floats


@dataclass(frozen=True)
class RightSide:
    """An equation of motion."""

    acceleration: Any
    """Compiled: (position, speed, command, parameters) → acceleration."""
    starts: tuple[tuple[float, ...], ...] = ()
    """Parameters from which the fit starts."""
    signed: tuple[int, ...] = ()
    """Which parameters may be below zero."""
    interpolated: bool = False
    """Whether the command is a signal that changes between the samples, not one that is held."""


@njit(cache=True)
def _cubic(x, v, u, p):  # type: ignore[no-untyped-def]
    """Return the acceleration of an oscillator whose spring has a constant, a square and a cubic part."""
    return p[2] * u - p[0] * v - p[1] * x - p[3] * x * x - p[4] * x**3 - p[5]


@njit(cache=True)
def _servo(x, v, u, p):  # type: ignore[no-untyped-def]
    """Return that of a servo with a pendulum, whose dry friction grows with the torque that its gears transmit."""
    gravity = p[2] * np.sin(x)
    drive = p[0] * (u - x)
    dry = (p[3] + p[4] * abs(drive - gravity)) * np.tanh(v / SLOW)
    return drive - p[1] * v - gravity - dry


@njit(cache=True)
def _pendulum(x, v, u, p):  # type: ignore[no-untyped-def]
    """Return that of a pendulum that a torque drives, with viscous and dry friction."""
    return p[2] * u - p[0] * v - p[1] * np.sin(x) - p[3] * np.tanh(v / SLOW)


@njit(cache=True)
def _drive(x, v, u, p):  # type: ignore[no-untyped-def]
    """Return that of a carriage with friction of its own in each direction."""
    rising = 0.5 * (1.0 + np.tanh(v / (1e-2 * SLOW)))
    forwards, backwards = p[1] * v + p[3], p[2] * v - p[4]
    return (u - rising * forwards - (1.0 - rising) * backwards - p[5] * x) / p[0]


RIGHT_SIDES = {
    "cubic": RightSide(_cubic, ((40.0, 1.8e5, 1.8e5, 0.0, 1e5, 0.0),), signed=(3, 4, 5), interpolated=True),
    "servo": RightSide(
        _servo, ((300.0, 30.0, 60.0, 20.0, 0.1), (1000.0, 60.0, 60.0, 20.0, 0.1), (100.0, 20.0, 60.0, 5.0, 0.1))
    ),
    "pendulum": RightSide(_pendulum, ((0.2, 20.0, 6.0, 1.0),)),
    "drive": RightSide(_drive),
}


@njit(cache=True)
def _integrate(acceleration, p, time, command, state, interpolated, longest):  # type: ignore[no-untyped-def]
    found = np.empty(len(time))
    x, v = state[0], state[1]
    found[0] = x
    for i in range(len(time) - 1):
        steps = max(int(np.ceil((time[i + 1] - time[i]) / longest)), 1)
        h = (time[i + 1] - time[i]) / steps
        slope = (command[i + 1] - command[i]) / (steps * h) if interpolated else 0.0
        for k in range(steps):
            u0 = command[i] + slope * k * h
            u1, u2 = u0 + slope * h / 2, u0 + slope * h
            a1 = acceleration(x, v, u0, p)
            a2 = acceleration(x + h / 2 * v, v + h / 2 * a1, u1, p)
            a3 = acceleration(x + h / 2 * (v + h / 2 * a1), v + h / 2 * a2, u1, p)
            a4 = acceleration(x + h * (v + h / 2 * a2), v + h * a3, u2, p)
            x += h * v + h * h / 6 * (a1 + a2 + a3)
            v += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
        found[i + 1] = x
    return found


def free_run(side: RightSide, p: Floats, series: Series, state: Floats) -> Floats:
    """Return the positions of a free run from a state (position, speed) at the samples of a series."""
    return np.asarray(_integrate(side.acceleration, p, series.time, series.command, state, side.interpolated, STEP_S))


def fit(side: RightSide, fitted: Sequence[Series], held_out: Sequence[Series]) -> list[Floats]:
    """Fit parameters and initial states to some series; return the residuals of the others, of which only the state is.

    Returns
    -------
    list of ndarray
        Measured minus predicted values of each held-out series.
    """
    count = len(side.starts[0])

    def residuals(x: Floats) -> Floats:
        runs = [free_run(side, x[:count], one, x[count + 2 * k :][:2]) for k, one in enumerate(fitted)]
        return _finite(np.concatenate([one.value - run for one, run in zip(fitted, runs, strict=True)]))

    states = np.concatenate([_start(one) for one in fitted])
    low = np.full(count + len(states), -np.inf)
    low[[k for k in range(count) if k not in side.signed]] = 0.0
    tries = [
        least_squares(residuals, np.append(start, states), bounds=(low, np.inf), x_scale="jac", max_nfev=100)
        for start in side.starts
    ]
    p = min(tries, key=lambda one: one.cost).x[:count]
    print(f"  by hand: {np.array2string(p, precision=4)}")
    found = []
    for one in held_out:
        best = least_squares(
            lambda state, one=one: _finite(one.value - free_run(side, p, one, state)), _start(one), x_scale="jac"
        )
        found.append(best.fun)
    return found


def _start(series: Series) -> Floats:
    return np.array([series.value[0], (series.value[3] - series.value[0]) / (series.time[3] - series.time[0])])


def _finite(residuals: Floats) -> Floats:
    return np.nan_to_num(np.clip(residuals, -1e6, 1e6), nan=1e6)
