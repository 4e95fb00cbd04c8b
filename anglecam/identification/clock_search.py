"""A coarse search for the offset between a command and the motion that it causes, from the motion alone.

For a plant with given natural frequency and damping the response to the command is known up to its gain. It is
simulated once and compared with the angle at every shift by whole steps: the share of the angle's variance that the
shifted response explains is the squared correlation. A few plants are enough, because the shift is refined afterwards.
"""

from __future__ import annotations

import math

import numpy as np

from anglecam.data.record import Record
from anglecam.data.typing import Floats
from anglecam.models.plant import Plant

PLANTS = tuple((hz, ratio) for hz in (0.5, 1.0, 2.0, 4.0) for ratio in (0.1, 0.4, 1.0))
"""Natural frequencies, Hz, and damping ratios of the plants that are tried."""
STEP = 0.02
"""Longest step between the offsets that are compared, s."""
SEARCHED_SHARE = 0.5
"""Largest offset, as a share of the recording's length."""
AS_GOOD = 1.5
"""Of several offsets the smallest is taken that leaves at most so many times the variance that the best one leaves: a
periodic command fits a period later nearly as well."""


def coarse_offset(record: Record) -> float:
    """Return the offset, s, by which the command has to be later for its response to resemble the angle.

    Parameters
    ----------
    record : Record
        With a command.

    Returns
    -------
    float
        Within half a recording; 0 where the command or the angle never changes.
    """
    command = record.command
    if command is None or command.first_change() is None:
        return 0.0
    step = min(STEP, record.interval)
    span = float(record.time[-1] - record.time[0])
    most = math.ceil(SEARCHED_SHARE * span / step)
    grid = record.time[0] + step * np.arange(math.floor(span / step) + 1)
    angle = np.interp(grid, record.time, record.angle)
    if not np.any(np.diff(angle)):
        return 0.0
    wide = grid[0] + step * np.arange(-most, len(grid) + most)
    left: Floats = np.full(2 * most + 1, np.inf)
    for hz, ratio in PLANTS:
        rate = 2.0 * math.pi * hz
        parameters = np.array([2.0 * ratio * rate, rate**2, rate**2])
        start = np.array([float(command.at(wide[:1])[0]), 0.0])
        response = Plant().predict(parameters, wide, command, start)
        left = np.minimum(left, 1.0 - _correlations(angle, response) ** 2)
    offsets: Floats = (
        np.arange(most, -most - 1, -1, dtype=np.float64) * step
    )  # an earlier part of the response is a later command
    good = np.flatnonzero(left <= AS_GOOD * left.min() + 1e-12)
    return _bottom_near(offsets, left, int(good[np.argmin(np.abs(offsets[good]))]))


def _bottom_near(offsets: Floats, left: Floats, at: int) -> float:
    """Return the offset at the local minimum to which the descent from a place leads."""
    while True:
        near = range(max(at - 1, 0), min(at + 2, len(left)))
        best = min(near, key=lambda i: left[i])
        if best == at:
            return float(offsets[at])
        at = best


def _correlations(angle: Floats, response: Floats) -> Floats:
    """Return the correlation of (n,) angles with each part of the same length of a longer response.

    A response that falls where the angle rises counts too: the sign of the gain is not known.
    """
    n = len(angle)
    centred = angle - angle.mean()
    along = np.correlate(response - response.mean(), centred, mode="valid")
    sums, squares = (np.concatenate([[0.0], np.cumsum(x)]) for x in (response, response**2))
    total = sums[n:] - sums[:-n]
    size = np.maximum(squares[n:] - squares[:-n] - total**2 / n, 0.0)
    whole = np.sqrt(size * float(centred @ centred))
    least = 1e-9 * float(whole.max())
    # of an angle that hardly moves, rounding leaves more than 1
    return np.clip(np.where(whole > least, along / np.maximum(whole, max(least, 1e-300)), 0.0), -1.0, 1.0)
