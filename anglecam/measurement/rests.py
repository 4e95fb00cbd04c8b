"""Where a measured angle is at rest: intervals that a motion and a rest describe better than one smooth motion.

A smooth motion is nearly still at each of its turning points. What tells a rest from a turning point is the motion
beside it: one that goes on smoothly needs few parameters for both, and one that stops needs as many parameters for each
second of the rest as for each second of the motion, unless the rest is described as a part of its own. Descriptions are
compared by the Bayesian information criterion (Schwarz 1978), χ² + K·ln n, with the stated noise. A description of a
part is the spline whose number of parameters K makes it least.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dst
from scipy.interpolate import make_lsq_spline
from scipy.stats import norm

from anglecam.data.step_figures import HIGH, LOW, first_crossing
from anglecam.data.typing import Floats

_BEYOND = 0.05
"""Probability with which noise alone leaves the band of a rest anywhere in the series."""
_STILL_SHARE = 0.005
"""Half-width, as a share of the series' range, within which an angle is at rest although it creeps."""
_LEAST_REST_FRAMES = 5
"""Least number of frames from which the noise of a level can be told."""
_GAP_FRAMES = 3.5
"""Frame intervals without a measurement beyond which the motion in between is unknown."""
_BESIDE = 2
"""How many times as long as an interval lasts the motion on either side of it is looked at."""
_EDGES = np.linspace(0.0, 0.5, 5)
"""Where a motion may end within the rest after it, as shares of the rest."""
_WALKS = np.geomspace(0.02, 20.0, 16)
"""Steps of the random walks that are tried, relative to the noise."""
_DENSER = 1.2
"""Ratio of the numbers of intervals of the splines that are tried."""


@dataclass(frozen=True)
class Rest:
    """An interval in which the angle is at rest."""

    first: int
    """Its first row."""
    last: int
    """Its last row."""
    level: float
    """Angle, rad."""
    sigma: float
    """Standard uncertainty of ``level``, rad."""


def resolution(y: Floats, s: Floats) -> float:
    """Return the half-width of the band in which an angle is at rest, rad.

    Parameters
    ----------
    y, s : ndarray
        (n,) angle and its noise, rad.
    """
    sigmas = float(norm.isf(_BEYOND / (2.0 * len(y))))
    return max(sigmas * float(np.median(s)), _STILL_SHARE * float(np.ptp(y)))


def gaps_after(t: Floats) -> NDArray[np.intp]:
    """Return the rows after which the motion is unknown for a while, of (n,) times."""
    return np.flatnonzero(np.diff(t) > _GAP_FRAMES * float(np.median(np.diff(t))))


def find_rests(t: Floats, y: Floats, s: Floats) -> list[Rest]:
    """Find the intervals in which the angle is at rest.

    Parameters
    ----------
    t : ndarray
        (n,) s, increasing.
    y, s : ndarray
        (n,) angle and the standard deviation of its noise, rad.

    Returns
    -------
    list of Rest
        In order of time. Each lasts at least as long as the rises to its neighbours.
    """
    band = resolution(y, s)
    # what is at rest may be anywhere in its band: a rectangular distribution (GUM 4.3.7)
    noise = np.hypot(s, _STILL_SHARE * float(np.ptp(y)) / np.sqrt(3.0))
    found = [part for part in _flat_parts(t, y, band) if _is_apart(t, y, noise, *part)]
    return _lasting([_rest(y, s, *part) for part in found], t, y, band)


def _rest(y: Floats, s: Floats, first: int, last: int) -> Rest:
    # its first half may still contain the end of a swing
    settled = slice((first + last) // 2, last + 1)
    count = settled.stop - settled.start
    # a median, because its last frames may belong to the next motion
    level = float(np.median(y[settled]))
    scatter = max(1.4826 * float(np.median(np.abs(y[settled] - level))), float(np.median(s[settled])))
    return Rest(first, last, level, scatter * np.sqrt(0.5 * np.pi / count))


def _is_apart(t: Floats, y: Floats, noise: Floats, first: int, last: int) -> bool:
    """Return whether neither what is before an interval nor what is after it goes on through it.

    The motion may end within the interval's half next to it, as the last swing of a motion that dies out does.
    """
    count = last - first + 1
    begin, end = max(first - _BESIDE * count, 0), min(last + 1 + _BESIDE * count, len(y))
    # the edges of rests are sought in the whole series
    price = float(np.log(len(y)))
    edges = np.unique(np.round(_EDGES * count)).astype(np.intp)

    def described(a: int, b: int) -> float:
        return _least_description(t[a:b], y[a:b], noise[a:b], price)

    start, stop, parts = first, last + 1, 1
    # fewer frames show no motion
    if first - begin >= _LEAST_REST_FRAMES:
        start = min(first + edges, key=lambda edge: described(begin, edge) + described(edge, stop))
        if described(begin, start) + described(start, stop) + price >= described(begin, stop):
            return False
        parts += 1
    else:
        begin = first
    if end - stop >= _LEAST_REST_FRAMES:
        stop = min(stop - edges, key=lambda edge: described(start, edge) + described(edge, end))
        if described(start, stop) + described(stop, end) + price >= described(start, end):
            return False
        parts += 1
    else:
        end = stop
    in_parts = described(begin, start) + described(start, stop) + described(stop, end) + (parts - 1) * price
    return parts == 1 or in_parts < described(begin, end)


def _least_description(t: Floats, y: Floats, noise: Floats, price: float) -> float:
    """Return the least χ² + K·price of smooth curves, of a random walk, and of the values themselves."""
    if len(y) == 0:
        return 0.0
    least = min(len(y) * price, _random_walk(y, noise) + 2.0 * price)
    for parameters, fitted in _smooth_curves(t, y, noise):
        if parameters * price >= least:
            break
        residual = (y - fitted) / noise
        least = min(least, float(residual @ residual) + parameters * price)
    return least


def _random_walk(y: Floats, noise: Floats) -> float:
    """Return the least -2·ln of the likelihood of a random walk in white noise, relative to that of noise without walk.

    The covariance of the differences is q²·I + r²·T, where T, with 2 in its diagonal and -1 beside it, has the sine
    transform's vectors as its eigenvectors. For a walk without steps, q = 0, this is χ² about the mean.
    """
    if len(y) < 2:
        return 0.0
    part = dst(np.diff(y) / float(np.median(noise)), type=1, norm="ortho") ** 2
    white = 2.0 - 2.0 * np.cos(np.pi * np.arange(1, len(y)) / len(y))
    walking = _WALKS[:, None] ** 2 + white
    return float((np.log(walking / white) + part / walking).sum(axis=1).min())


def _smooth_curves(t: Floats, y: Floats, noise: Floats) -> Iterator[tuple[int, Floats]]:
    """Yield numbers of parameters, increasing, with the least-squares curves that have so many."""
    n = len(y)
    for degree in range(min(3, n - 1)):
        yield degree + 1, np.polynomial.Polynomial.fit(t, y, degree, w=1.0 / noise)(t)
    intervals = 1
    while intervals + 3 < n:
        inner = t[np.round(np.linspace(0, n - 1, intervals + 1)[1:-1]).astype(np.intp)]
        knots = np.concatenate([np.repeat(t[0], 4), inner, np.repeat(t[-1], 4)])
        yield intervals + 3, make_lsq_spline(t, y, knots, 3, w=1.0 / noise)(t)
        intervals = max(intervals + 1, round(_DENSER * intervals))


def _flat_parts(t: Floats, y: Floats, band: float) -> list[tuple[int, int]]:
    """Return the first and last rows of the intervals within ±band, the longest chosen first, in order of time."""
    taken = np.zeros(len(y), bool)
    chosen = []
    for first, last in sorted(_windows(t, y, band), key=lambda ends: t[ends[0]] - t[ends[1]]):
        if last - first + 1 >= _LEAST_REST_FRAMES and not taken[first : last + 1].any():
            taken[first : last + 1] = True
            chosen.append((first, last))
    return sorted(chosen)


def _windows(t: Floats, y: Floats, band: float) -> list[tuple[int, int]]:
    """Return the longest intervals of rows in which the angle's range is within 2·band."""
    windows: list[tuple[int, int]] = []
    low: deque[int] = deque()
    high: deque[int] = deque()
    after_gap = {int(k) + 1 for k in gaps_after(t)}
    first = 0
    for i in range(len(y)):
        if i in after_gap:
            windows.append((first, i - 1))
            first = i
            low.clear()
            high.clear()
        while low and y[low[-1]] >= y[i]:
            low.pop()
        while high and y[high[-1]] <= y[i]:
            high.pop()
        low.append(i)
        high.append(i)
        if y[high[0]] - y[low[0]] > 2.0 * band:
            windows.append((first, i - 1))
            while y[high[0]] - y[low[0]] > 2.0 * band:
                first += 1
                for ends in (low, high):
                    if ends[0] < first:
                        ends.popleft()
    windows.append((first, len(y) - 1))
    return windows


def _lasting(rests: list[Rest], t: Floats, y: Floats, band: float) -> list[Rest]:
    """Remove pauses: an interval shorter than the rise before or after it is no rest."""
    while len(rests) > 1:
        rises = [_rough_rise(t, y, a, b, band) for a, b in pairwise(rests)]
        neighbours = [max(pair) for pair in pairwise([0.0, *rises, 0.0])]
        lasting = [(t[r.last] - t[r.first]) / max(rise, 1e-9) for r, rise in zip(rests, neighbours, strict=True)]
        if min(lasting) >= 1.0:
            break
        del rests[int(np.argmin(lasting))]
    return rests


def _rough_rise(t: Floats, y: Floats, before: Rest, after: Rest, band: float) -> float:
    rows = slice(before.last, after.first + 1)
    way = after.level - before.level
    if abs(way) < 2.0 * band:
        # out and back: neither rise can be longer than half the interval
        return 0.5 * float(t[after.first] - t[before.last])
    share = (y[rows] - before.level) / way
    return first_crossing(t[rows], share, HIGH) - first_crossing(t[rows], share, LOW)
