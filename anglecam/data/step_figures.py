"""Figures of a step response as MATLAB's ``stepinfo`` defines them, from shares of the way from rest to rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anglecam.data.typing import Floats

LOW, HIGH, SETTLED = 0.1, 0.9, 0.02
"""Shares of the way: the rise goes from the first to the second; settled is within the third of the end."""


@dataclass(frozen=True)
class StepFigures:
    """Figures of a step response; NaN where the model has no steady state."""

    rise_time: float
    """Time from 10 % to 90 % of the way, s."""
    overshoot: float
    """Peak beyond the steady state as a share of it, not below 0."""
    settling_time: float
    """Time after which the response stays within 2 % of the steady state, s."""
    steady_state: float
    """Angle per unit of the command."""


NO_STEP = StepFigures(np.nan, np.nan, np.nan, np.nan)
"""For a model without a steady state, or without a command."""


def first_crossing(time: Floats, share: Floats, level: float) -> float:
    """Return the time at which a response first reaches a level.

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
        s, interpolated; the last time if it never reaches the level.
    """
    i = int(np.argmax(share >= level))
    if i == 0:
        return float(time[0] if share[0] >= level else time[-1])
    return float(np.interp(level, share[i - 1 : i + 1], time[i - 1 : i + 1]))


def last_rise(time: Floats, value: Floats) -> float:
    """Return the time at which a value rises through zero for the last time.

    Parameters
    ----------
    time : ndarray
        (n,) s.
    value : ndarray
        (n,).

    Returns
    -------
    float
        s, interpolated; the first time if the value is never below zero, the last if it is below zero at the end.
    """
    below = np.flatnonzero(value < 0.0)
    if not len(below):
        return float(time[0])
    i = int(below[-1])
    if i + 1 == len(time):
        return float(time[-1])
    return float(np.interp(0.0, value[i : i + 2], time[i : i + 2]))


def settling(time: Floats, share: Floats) -> float:
    """Return the time, s, from which a response stays within `SETTLED` of its end.

    Parameters
    ----------
    time : ndarray
        (n,) s.
    share : ndarray
        (n,) of the way, 0 before and 1 after.
    """
    return last_rise(time, SETTLED - np.abs(share - 1.0))
