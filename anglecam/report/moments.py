"""Which frames of a film a page shows.

Failures, the largest values of what is judged (the residual, or sigma), changes of the command and turning points get
up to a fifth of the pictures each; the rest is spread evenly over the recording.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from anglecam.data.series import AngleSeries
from anglecam.data.typing import Floats

SHARE = 5
"""One kind of moments gets at most one picture in so many."""
TURN_SHARE = 0.05
"""A turning point is an extreme from which the angle departs by more than this share of its range."""
EVENLY = "evenly spaced"


@dataclass(frozen=True)
class Moment:
    """A frame to show."""

    row: int
    """Row of the series."""
    why: str
    """Why it is shown, in words."""


def choose_moments(
    series: AngleSeries, judged: Floats | None, name: str, changes: Sequence[float], most: int
) -> tuple[Moment, ...]:
    """Choose the frames of a recording that a page shows.

    Parameters
    ----------
    series : AngleSeries
        The recording, of n rows.
    judged : (n,) ndarray or None
        What is judged, such as the residual; NaN where there is none. The frames with its largest sizes are shown.
    name : str
        Its name, for the reason.
    changes : sequence of float
        Times at which the command changes, s.
    most : int
        Largest number of frames.

    Returns
    -------
    tuple of Moment
        In the order of the rows; all rows where ``most`` is not exceeded.

    Examples
    --------
    >>> swing = AngleSeries("a", np.arange(5.0), np.array([0, 1, 0, -1, 0.0]), np.full(5, 0.1), ("ok",) * 5)
    >>> [(m.row, m.why) for m in choose_moments(swing, None, "", [2.0], 5)]
    [(0, 'evenly spaced'), (1, 'turning point'), (2, 'the command changes'), (3, 'evenly spaced'), (4, 'evenly spaced')]
    """
    n = len(series.time)
    quota = max(1, most // SHARE)
    apart = max(1, n // (2 * most))
    why: dict[int, list[str]] = {}
    kinds = [
        ("", _failures(series)[:quota]),
        (f"largest {name}", [] if judged is None else _largest(np.abs(judged), quota, apart)),
        ("the command changes", _thinned(_first_after(series.time, changes), quota)),
        ("turning point", _thinned(_turning_points(series.angle), quota)),
    ]
    for kind, rows in kinds:
        for row in rows:
            if row in why or len(why) < most:
                why.setdefault(row, []).append(kind or f"no angle: {series.status[row]}")
    for row in _evenly(n, sorted(why), most - len(why)):
        why[row] = [EVENLY]
    return tuple(Moment(row, ", ".join(why[row])) for row in sorted(why))


def _failures(series: AngleSeries) -> list[int]:
    """Return the middle of each run of frames without an angle, longest run first; what has no picture is left out."""
    lost = ~series.ok & (np.array(series.status) != "undecodable")
    edges = np.flatnonzero(np.diff(np.concatenate([[0], lost.astype(int), [0]])))
    runs = sorted(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True), key=lambda run: (run[0] - run[1], run))
    return [(start + stop - 1) // 2 for start, stop in runs]


def _largest(size: Floats, most: int, apart: int) -> list[int]:
    """Return the rows of the largest values, largest first, no two closer than ``apart`` rows."""
    left = np.where(np.isfinite(size), size, -1.0)
    rows: list[int] = []
    while len(rows) < most and left.max(initial=-1.0) > 0.0:
        row = int(np.argmax(left))
        rows.append(row)
        left[max(0, row - apart + 1) : row + apart] = -1.0
    return rows


def _first_after(time: Floats, changes: Sequence[float]) -> list[int]:
    rows = np.unique(np.searchsorted(time, np.asarray(changes, float)))
    return [int(row) for row in rows if row < len(time)]


def _turning_points(angle: Floats) -> list[int]:
    """Return the extremes between which the angle moves by more than `TURN_SHARE` of its range."""
    rows = np.flatnonzero(np.isfinite(angle))
    if len(rows) == 0:
        return []
    least = TURN_SHARE * float(np.ptp(angle[rows]))
    turns: list[int] = []
    low = high = best = int(rows[0])
    rising: bool | None = None
    for row in rows.tolist():
        low = row if angle[row] < angle[low] else low
        high = row if angle[row] > angle[high] else high
        best = high if rising else low
        if rising is None and angle[high] - angle[low] > least:
            rising = high > low
        elif rising is not None and abs(angle[row] - angle[best]) > least:
            turns.append(best)
            rising, low, high = not rising, row, row
    return turns


def _thinned(rows: Sequence[int], most: int) -> list[int]:
    """Return at most ``most`` of the rows, evenly spread over them."""
    if len(rows) <= most:
        return list(rows)
    return [rows[k] for k in np.unique(np.linspace(0, len(rows) - 1, most).round().astype(int))]


def _evenly(n: int, taken: Sequence[int], count: int) -> list[int]:
    """Return ``count`` more rows of n, each in the middle of the largest gap that is left; the ends come first."""
    added = [row for row in (0, n - 1) if row not in taken][: max(count, 0)]
    known = sorted({*taken, *added})
    while len(added) < min(count, n - len(taken)):
        gaps = np.diff(known)
        k = int(np.argmax(gaps))
        row = known[k] + int(gaps[k]) // 2
        known.insert(k + 1, row)
        added.append(row)
    return added
