"""Rise time, overshoot and settling time of measured motion, from one rest to the next.

The figures are those of MATLAB's ``stepinfo``: rise from 10 % to 90 % of the step, overshoot beyond the final rest as a
share of the step, settling to within 2 % of the step for good. Between frames the angle is interpolated by a smoothing
spline that stays within the noise (Reinsch 1967). Each figure's uncertainty combines the propagated noise (Monte Carlo,
GUM Supplement 1) and the difference that another spline makes.
"""

from __future__ import annotations

import warnings
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import UnivariateSpline

from anglecam.data.step_figures import HIGH, LOW, SETTLED, first_crossing, last_rise, settling
from anglecam.data.typing import Floats

_STILL_SIGMAS, _STILL_SHARE = 3.0, 0.005
"""Half-width of the band of a rest: multiple of sigma, or share of the clip's range, whichever is larger."""
_FLAT = 0.5
"""Share of that half-width by which the means of a rest's three parts may differ."""
_LEAST_REST_S, _LEAST_REST_FRAMES = 0.1, 5
_LEAST_WAY = 6.0
"""Half-widths of that band; a smaller step between two rests is no response."""
_GAP_FRAMES = 3.5
"""Frame intervals without a measurement beyond which the motion in between is unknown."""
_DRAWS = 100
_MARGIN_FRAMES = 60
"""Frames of either rest that the spline is fitted to."""
_PER_FRAME = 32
"""Points between two frames at which a curve is evaluated."""


@dataclass(frozen=True)
class Figure:
    """A quantity of a response."""

    value: float
    """NaN where the frames that determine it are missing."""
    sigma: float
    """Standard uncertainty."""


@dataclass(frozen=True)
class Response:
    """The motion from one rest to another."""

    start: Figure
    """Start, s: the command's change where it is known, else the time at which the angle leaves the rest by 2 %."""
    from_angle: Figure
    """Angle of the rest before, rad."""
    to_angle: Figure
    """Angle of the rest after, the steady state, rad."""
    rise_time: Figure
    """From 10 % to 90 % of the step, s."""
    overshoot: Figure
    """Largest excursion beyond ``to_angle`` as a share of the step, not below 0."""
    settling_time: Figure
    """From ``start`` until the angle stays within 2 % of the step around ``to_angle``, s."""
    peak_speed: Figure
    """Greatest angular speed towards ``to_angle``, rad/s."""


@dataclass(frozen=True)
class _Rest:
    first: int
    last: int
    level: float
    sigma: float


def responses(time: Floats, angle: Floats, sigma: Floats, changes: Sequence[float] = ()) -> tuple[Response, ...]:
    """Find every motion from one rest to another, and its figures.

    A rest is an interval in which the angle stays in a narrow band without curvature or drift, and which lasts at least
    as long as the rises before and after it. A turning point of a swing and a short pause are not rests. A motion that
    goes beyond its end by more than its height is an excursion: no stable system of second order answers a step so.

    Parameters
    ----------
    time : ndarray
        (n,) s, increasing; intervals may differ.
    angle : ndarray
        (n,) rad; NaN where it was not measured.
    sigma : ndarray
        (n,) standard deviation of what differs from frame to frame, rad; where it is NaN, it is estimated from the
        angle's second differences.
    changes : sequence of float
        Times at which a command changed, s, where they are known. A response then begins at the last change before the
        angle leaves its rest. A motion during which the command changed again is no response to one change and is
        left out.

    Returns
    -------
    tuple of Response
        In order of time; empty where the angle never rests or never leaves its rest.
    """
    seen = np.isfinite(angle) & np.isfinite(time)
    t, y, s = time[seen], angle[seen], sigma[seen]
    if len(t) < 2 * _LEAST_REST_FRAMES:
        return ()
    s = np.where(np.isfinite(s), s, _roughness(y))
    band = max(_STILL_SIGMAS * float(np.median(s)), _STILL_SHARE * float(np.ptp(y)))
    rests = _lasting(_distinct(_rests(t, y, s, band), t, y, band), t, y, band)
    found, frame = [], float(np.median(np.diff(t)))
    for before, after in pairwise(rests):
        # with a delay the angle stays at rest for a while after the change that moves it
        away = np.abs(y[before.last : after.first + 1] - before.level) > 2.0 * band
        leaves = t[before.last + int(np.argmax(away))]
        causes = [c for c in changes if t[before.first] <= c <= leaves]
        again = any(leaves < c < t[after.first] for c in changes)
        if abs(after.level - before.level) >= _LEAST_WAY * band and not again and not _is_excursion(y, before, after):
            found.append(_response(t, y, s, before, after, causes[-1] if causes else None, frame))
    return tuple(found)


def _is_excursion(y: Floats, before: _Rest, after: _Rest) -> bool:
    """Return whether the angle between two rests overshoots either by more than 100 % of the way."""
    way = after.level - before.level
    share = (y[before.last : after.first + 1] - before.level) / way
    return bool(share.max() > 2.0 or share.min() < -1.0)


def responses_as_dicts(answers: Sequence[Response]) -> list[dict[str, dict[str, float]]]:
    """Return the content of ``NAME.responses.json``: angles in degrees, overshoot as a share."""
    in_degrees = {"from_angle": "from_deg", "to_angle": "to_deg", "peak_speed": "peak_speed_deg_per_s"}
    in_seconds = {"start": "start_s", "rise_time": "rise_time_s", "settling_time": "settling_time_s"}

    def figure(answer: Response, name: str, factor: float) -> dict[str, float]:
        quantity: Figure = getattr(answer, name)
        return {"value": factor * quantity.value, "sigma": factor * quantity.sigma}

    return [
        {key: figure(answer, name, 1.0) for name, key in in_seconds.items()}
        | {key: figure(answer, name, 180.0 / np.pi) for name, key in in_degrees.items()}
        | {"overshoot": figure(answer, "overshoot", 1.0)}
        for answer in answers
    ]


def _roughness(y: Floats) -> float:
    """Estimate white noise from second differences, which are small for a smooth motion."""
    second = np.diff(y, 2)
    return max(1.4826 * float(np.median(np.abs(second - np.median(second)))) / np.sqrt(6.0), 1e-9)


def _rests(t: Floats, y: Floats, s: Floats, band: float) -> list[_Rest]:
    """List the flat intervals within ±band, the longest chosen first, in order of time."""
    frame = float(np.median(np.diff(t)))
    parts = [_flat_part(y, first, last, band) for first, last in _windows(t, y, band, _GAP_FRAMES * frame)]
    lasting = [p for p in parts if p[1] - p[0] + 1 >= _LEAST_REST_FRAMES and t[p[1]] - t[p[0]] >= _LEAST_REST_S]
    taken: list[tuple[int, int]] = []
    for first, last in sorted(lasting, key=lambda p: t[p[0]] - t[p[1]]):
        if not any(first <= b and a <= last for a, b in taken):
            taken.append((first, last))
    rests = []
    for first, last in sorted(taken):
        # its first half may still contain the end of a swing
        settled = slice((first + last) // 2, last + 1)
        count = settled.stop - settled.start
        # a median, because its last frames may belong to the next motion
        level = float(np.median(y[settled]))
        scatter = max(1.4826 * float(np.median(np.abs(y[settled] - level))), float(np.median(s[settled])))
        rests.append(_Rest(first, last, level, scatter * np.sqrt(0.5 * np.pi / count)))
    return rests


def _flat_part(y: Floats, first: int, last: int, band: float) -> tuple[int, int]:
    """Cut off one end until the rest has neither the curvature of a turning point nor the drift of a slow ramp."""
    for cut in np.linspace(0.0, 0.75, 13):
        off = round(cut * (last - first))
        for a, b in ((first + off, last), (first, last - off)):
            if b - a + 1 >= _LEAST_REST_FRAMES:
                thirds = [float(part.mean()) for part in np.array_split(y[a : b + 1], 3)]
                if np.ptp(thirds) <= _FLAT * band:
                    return a, b
    return first, first


def _windows(t: Floats, y: Floats, band: float, gap: float) -> list[tuple[int, int]]:
    """Return the longest intervals of rows in which the angle's range is within 2·band."""
    windows: list[tuple[int, int]] = []
    low: deque[int] = deque()
    high: deque[int] = deque()
    first = 0
    for i in range(len(y)):
        if i and t[i] - t[i - 1] > gap:
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


def _distinct(rests: list[_Rest], t: Floats, y: Floats, band: float) -> list[_Rest]:
    """Of two rests with only the end of a swing between them keep the longer: the other is a turning point."""
    kept: list[_Rest] = []
    for rest in rests:
        kept.append(rest)
        while len(kept) > 1 and np.ptp(y[kept[-2].first : kept[-1].last + 1]) < _LEAST_WAY * band:
            del kept[-2 if t[kept[-2].last] - t[kept[-2].first] < t[kept[-1].last] - t[kept[-1].first] else -1]
    return kept


def _lasting(rests: list[_Rest], t: Floats, y: Floats, band: float) -> list[_Rest]:
    """Remove pauses: an interval shorter than the rise before or after it is no rest."""
    while len(rests) > 1:
        rises = [_rough_rise(t, y, a, b, band) for a, b in pairwise(rests)]
        neighbours = [max(pair) for pair in pairwise([0.0, *rises, 0.0])]
        lasting = [(t[r.last] - t[r.first]) / max(rise, 1e-9) for r, rise in zip(rests, neighbours, strict=True)]
        if min(lasting) >= 1.0:
            break
        del rests[int(np.argmin(lasting))]
    return rests


def _rough_rise(t: Floats, y: Floats, before: _Rest, after: _Rest, band: float) -> float:
    rows = slice(before.last, after.first + 1)
    way = after.level - before.level
    if abs(way) < 2.0 * band:
        # out and back: neither rise can be longer than half the interval
        return 0.5 * float(t[after.first] - t[before.last])
    share = (y[rows] - before.level) / way
    return first_crossing(t[rows], share, HIGH) - first_crossing(t[rows], share, LOW)


def _response(
    t: Floats, y: Floats, s: Floats, before: _Rest, after: _Rest, begun: float | None, frame: float
) -> Response:
    rows = slice(max(before.first, before.last - _MARGIN_FRAMES), min(after.last, after.first + _MARGIN_FRAMES) + 1)
    t, y, s = t[rows], y[rows], s[rows]
    grid = np.interp(np.arange((len(t) - 1) * _PER_FRAME + 1) / _PER_FRAME, np.arange(len(t)), t)
    levels = before.level, after.level
    curve = _smooth(t, y, s)
    figures = _read(curve, grid, levels, begun)
    # between frames the curve is interpolated; where the acceleration jumps, a spline's error grows with the square of
    # the interval, so that with every second frame it is larger by three times its value (Richardson 1911)
    halves = [_read(_smooth(t[k::2], y[k::2], s[k::2]), grid, levels, begun) for k in (0, 1)]
    interpolation = np.sqrt(np.mean([((half - figures) / 3.0) ** 2 for half in halves], axis=0))
    rng = np.random.default_rng(0)
    drawn = np.array(
        [
            _read(
                _smooth(t, curve(t) + s * rng.standard_normal(len(t)), s),
                grid,
                (
                    before.level + before.sigma * rng.standard_normal(),
                    after.level + after.sigma * rng.standard_normal(),
                ),
                begun,
            )
            for _ in range(_DRAWS)
        ]
    )
    # smoothing slows a rise: the bias of smoothing the curve a second time estimates that of the first
    sigma = np.sqrt(drawn.var(axis=0) + (drawn.mean(axis=0) - figures) ** 2 + interpolation**2)
    start, low, high, settled = figures[:4]
    gaps = np.flatnonzero(np.diff(t) > _GAP_FRAMES * frame)
    blind = [(t[g], t[g + 1]) for g in gaps]

    def figure(value: float, error: float, needs: Sequence[float], whole: bool = False) -> Figure:
        ends = min(needs), max(needs)
        lost = (
            any(a < ends[1] and b > ends[0] for a, b in blind)
            if whole
            else any(a < moment < b for a, b in blind for moment in needs)
        )
        return Figure(np.nan, np.nan) if lost else Figure(float(value), float(error))

    return Response(
        start=figure(start, sigma[0], [start]),
        from_angle=Figure(before.level, before.sigma),
        to_angle=Figure(after.level, after.sigma),
        rise_time=figure(high - low, sigma[4], [low, high]),
        overshoot=figure(figures[5], sigma[5], [high, settled, t[-1]], whole=True),
        settling_time=figure(settled - start, sigma[6], [start, settled]),
        peak_speed=figure(figures[7], sigma[7], [low, high], whole=True),
    )


def _smooth(t: Floats, y: Floats, s: Floats) -> UnivariateSpline:
    """Fit the smoothest spline whose residual is the noise."""
    with warnings.catch_warnings():
        # where the noise was overestimated the spline stops before reaching it, which is harmless
        warnings.simplefilter("ignore", UserWarning)
        return UnivariateSpline(t, y, w=1.0 / s, s=len(t))


def _read(curve: UnivariateSpline, grid: Floats, levels: tuple[float, float], begun: float | None) -> Floats:
    """Return start, 10 %, 90 %, settled (s), rise, overshoot, settling and peak speed of a curve."""
    way = levels[1] - levels[0]
    share = (curve(grid) - levels[0]) / way
    low, high = first_crossing(grid, share, LOW), first_crossing(grid, share, HIGH)
    first = int(np.searchsorted(grid, low))
    start = begun if begun is not None else last_rise(grid[: first + 1], share[: first + 1] - SETTLED)
    settled = settling(grid, share)
    overshoot = max(0.0, float(share.max()) - 1.0)
    speed = float((np.sign(way) * curve.derivative()(grid)).max())
    return np.array([start, low, high, settled, high - low, overshoot, settled - start, speed])
