"""When a response passes what MATLAB's ``stepinfo`` measures it by: shares of the way from rest to rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anglecam.data.typing import Floats

LOW, HIGH, SETTLED = 0.1, 0.9, 0.02
"""Shares of the way: rise from the first to the second, settling to within the third."""


@dataclass(frozen=True)
class StepFigures:
    """Figures of a step response; NaN where the model has no steady state."""

    rise_time: float
    """From 10 % to 90 % of the way, s."""
    overshoot: float
    """Peak beyond the steady state as a share of it, not below 0."""
    settling_time: float
    """After which the response stays within 2 % of the steady state, s."""
    steady_state: float
    """Per unit of the command."""


NO_STEP = StepFigures(np.nan, np.nan, np.nan, np.nan)


def first_crossing(time: Floats, share: Floats, level: float) -> float:
    """Return when a response first reaches a level.

    Parameters
    ----------
    time : ndarray
        (n,) s.
    share : ndarray
        (n,) of the way, 0 before and 1 after.
    level : float
        The share to reach.

    Returns
    -------
    float
        s, interpolated; the last time where it never does.
    """
    i = int(np.argmax(share >= level))
    if i == 0:
        return float(time[0] if share[0] >= level else time[-1])
    return float(np.interp(level, share[i - 1 : i + 1], time[i - 1 : i + 1]))


def last_rise(time: Floats, value: Floats) -> float:
    """Return when a value rises through zero for the last time.

    Parameters
    ----------
    time : ndarray
        (n,) s.
    value : ndarray
        (n,).

    Returns
    -------
    float
        s, interpolated; the first time where it is never below, the last where it is so at the end.
    """
    below = np.flatnonzero(value < 0.0)
    if not len(below):
        return float(time[0])
    i = int(below[-1])
    if i + 1 == len(time):
        return float(time[-1])
    return float(np.interp(0.0, value[i : i + 2], time[i : i + 2]))


def settling(time: Floats, share: Floats) -> float:
    """Return from when on a response stays within `SETTLED` of where it goes, s.

    Parameters
    ----------
    time : ndarray
        (n,) s.
    share : ndarray
        (n,) of the way.
    """
    return last_rise(time, SETTLED - np.abs(share - 1.0))
