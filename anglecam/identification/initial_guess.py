"""Starting values of a fit of θ̈ + aθ̇ + bθ = cu that need no initial guess.

For given a and b the prediction is linear in all other unknowns: in c, in each recording's initial state and in its
zero. A coarse grid over natural frequency and damping ratio, with a linear solution at each node (variable projection;
Golub and Pereyra, SIAM J. Numer. Anal. 10, 1973), therefore covers the whole range.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from anglecam.data.record import Record
from anglecam.data.typing import Floats
from anglecam.models.plant import Plant

DAMPING_RATIOS = (0.01, 0.05, 0.2, 0.5, 0.8, 1.5, 4.0)
"""Damping ratios of the grid, from weakly to strongly damped."""
FREQUENCIES = 28
"""Number of natural frequencies of the grid, from half a period in the longest recording to 0.7 of the Nyquist rate."""


def start_parameters(records: Sequence[Record], *, count: int = 3) -> list[Floats]:
    """Return the nodes of the grid with the smallest squared error.

    Parameters
    ----------
    records : sequence of Record
        Recordings of one plant.
    count : int
        How many nodes to return.

    Returns
    -------
    list of (3,) or (2,) ndarray
        a (1/s), b (1/s²) and, where any recording is driven, c (1/s²), best first.
    """
    driven = any(r.command is not None for r in records)
    longest = max(r.time[-1] - r.time[0] for r in records)
    finest = min(r.interval for r in records)
    frequencies = np.geomspace(math.pi / longest, 0.7 * math.pi / finest, FREQUENCIES)
    found: list[tuple[float, Floats]] = []
    for frequency in frequencies:
        for ratio in DAMPING_RATIOS:
            a, b = 2.0 * ratio * frequency, frequency**2
            cost, c = _project(records, a, b, driven)
            if math.isfinite(cost):
                found.append((cost, np.array([a, b, c] if driven else [a, b])))
    found.sort(key=lambda item: item[0])
    return [start for _, start in found[:count]]


def _project(records: Sequence[Record], a: float, b: float, driven: bool) -> tuple[float, float]:
    """Return the least squared error at (a, b) and the value of c at which it occurs."""
    plant = Plant()
    normal = moment = total = 0.0
    for record in records:
        free = [plant.predict(np.array([a, b, 0.0]), record.time, None, np.array(s)) for s in ([1.0, 0.0], [0.0, 1.0])]
        nuisance = np.column_stack(free if record.zero_known else [*free, np.ones(len(record.time))])
        if not np.all(np.isfinite(nuisance)):
            return math.inf, math.nan
        q, _ = np.linalg.qr(nuisance)
        rest = record.angle - q @ (q.T @ record.angle)
        total += float(rest @ rest)
        if record.command is not None:
            forced = plant.predict(np.array([a, b, b]), record.time, record.command, np.zeros(2))
            forced = forced - q @ (q.T @ forced)
            normal += float(forced @ forced)
            moment += float(forced @ rest)
    if not driven:
        return total, math.nan
    gain = moment / normal if normal > 0.0 else 0.0
    return total - gain * moment, gain * b
