"""Rise, overshoot and settling of measured motion, from one rest to the next, robot or human alike.

The figures are MATLAB's ``stepinfo`` on data: rise from 10 % to 90 % of the way, overshoot beyond the level where the
motion comes to rest as a share of the way, settling to within 2 % of the way for good. A film has a frame every so
often, so the angle is read between frames from a smoothing spline that stays within the noise (Reinsch 1967); each
figure's uncertainty is what noise makes of it (Monte Carlo, GUM Supplement 1) and what another spline would have said.
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
"""Half-width of the band that a rest stays in: times sigma, of the clip's whole range; the larger holds."""
_FLAT = 0.5
"""Of that half-width, by which the means of a rest's three parts may differ."""
_LEAST_REST_S, _LEAST_REST_FRAMES = 0.1, 5
_LEAST_WAY = 6.0
"""Half-widths of that band; a shorter way between two rests is no response."""
_GAP_FRAMES = 3.5
"""Frame intervals without a measurement from which on what happened in them is not known."""
_DRAWS = 100
_MARGIN_FRAMES = 60
"""Of either rest that the spline sees."""
_PER_FRAME = 32
"""Points between two frames at which a curve is looked at."""


@dataclass(frozen=True)
class Figure:
    """A number read off a response."""

    value: float
    """NaN where frames that tell it are missing."""
    sigma: float
    """Standard uncertainty."""


@dataclass(frozen=True)
class Response:
    """The way from one rest to another."""

    start: Figure
    """When it begins, s: the command's change where that is known, else when the angle leaves the rest by 2 %."""
    from_angle: Figure
    """Level of the rest before, rad."""
    to_angle: Figure
    """Level of the rest after: the steady state, rad."""
    rise_time: Figure
    """From 10 % to 90 % of the way, s."""
    overshoot: Figure
    """Farthest beyond ``to_angle`` as a share of the way, not below 0."""
    settling_time: Figure
    """From ``start`` until the angle stays within 2 % of the way of ``to_angle``, s."""
    peak_speed: Figure
    """Greatest angular speed towards ``to_angle``, rad/s."""


@dataclass(frozen=True)
class _Rest:
    first: int
    last: int
    level: float
    sigma: float


def responses(time: Floats, angle: Floats, sigma: Floats, changes: Sequence[float] = ()) -> tuple[Response, ...]:
    """Find every way from one rest to another, and its figures.

    A rest is a stretch that stays in a narrow band and neither bends nor creeps in it, and lasts at least as long as
    the rises before and after it: a turning point of a swing and a pause on the way are none.

    Parameters
    ----------
    time : ndarray
        (n,) s, increasing; intervals may differ.
    angle : ndarray
        (n,) rad; NaN where it was not measured.
    sigma : ndarray
        (n,) standard uncertainty, rad; where it is NaN throughout, it is taken from the angle's own roughness.
    changes : sequence of float
        Times at which a command changed, s, where they are known: a response then begins at the last one before the
        angle leaves its rest, and a way on which it changed again is no response to one change and is left out.

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
        # what acts late is answered late: the angle may stay at rest for a while after the change that moves it
        away = np.abs(y[before.last : after.first + 1] - before.level) > 2.0 * band
        leaves = t[before.last + int(np.argmax(away))]
        meant = [c for c in changes if t[before.first] <= c <= leaves]
        again = any(leaves < c < t[after.first] for c in changes)
        if abs(after.level - before.level) >= _LEAST_WAY * band and not again:
            found.append(_response(t, y, s, before, after, meant[-1] if meant else None, frame))
    return tuple(found)


def responses_as_dicts(answers: Sequence[Response]) -> list[dict[str, dict[str, float]]]:
    """Return what ``NAME.responses.json`` holds, angles in degrees; overshoot is a share."""
    in_degrees = {"from_angle": "from_deg", "to_angle": "to_deg", "peak_speed": "peak_speed_deg_per_s"}
    in_seconds = {"start": "start_s", "rise_time": "rise_time_s", "settling_time": "settling_time_s"}

    def told(answer: Response, name: str, factor: float) -> dict[str, float]:
        figure: Figure = getattr(answer, name)
        return {"value": factor * figure.value, "sigma": factor * figure.sigma}

    return [
        {key: told(answer, name, 1.0) for name, key in in_seconds.items()}
        | {key: told(answer, name, 180.0 / np.pi) for name, key in in_degrees.items()}
        | {"overshoot": told(answer, "overshoot", 1.0)}
        for answer in answers
    ]


def _roughness(y: Floats) -> float:
    """Estimate white noise from second differences, which a smooth motion hardly has."""
    second = np.diff(y, 2)
    return max(1.4826 * float(np.median(np.abs(second - np.median(second)))) / np.sqrt(6.0), 1e-9)


def _rests(t: Floats, y: Floats, s: Floats, band: float) -> list[_Rest]:
    """List stretches that stay within ±band and are flat, the longest first chosen, in order of time."""
    frame = float(np.median(np.diff(t)))
    parts = [_flat_part(y, first, last, band) for first, last in _windows(t, y, band, _GAP_FRAMES * frame)]
    lasting = [p for p in parts if p[1] - p[0] + 1 >= _LEAST_REST_FRAMES and t[p[1]] - t[p[0]] >= _LEAST_REST_S]
    taken: list[tuple[int, int]] = []
    for first, last in sorted(lasting, key=lambda p: t[p[0]] - t[p[1]]):
        if not any(first <= b and a <= last for a, b in taken):
            taken.append((first, last))
    rests = []
    for first, last in sorted(taken):
        # its first half may still hold the last of a swing
        settled = slice((first + last) // 2, last + 1)
        count = settled.stop - settled.start
        # a median, since its last frames may be on the way already
        level = float(np.median(y[settled]))
        scatter = max(1.4826 * float(np.median(np.abs(y[settled] - level))), float(np.median(s[settled])))
        rests.append(_Rest(first, last, level, scatter * np.sqrt(0.5 * np.pi / count)))
    return rests


def _flat_part(y: Floats, first: int, last: int, band: float) -> tuple[int, int]:
    """Cut off one end until what is left neither bends, as a turning point does, nor creeps, as a slow ramp."""
    for cut in np.linspace(0.0, 0.75, 13):
        off = round(cut * (last - first))
        for a, b in ((first + off, last), (first, last - off)):
            if b - a + 1 >= _LEAST_REST_FRAMES:
                thirds = [float(part.mean()) for part in np.array_split(y[a : b + 1], 3)]
                if np.ptp(thirds) <= _FLAT * band:
                    return a, b
    return first, first


def _windows(t: Floats, y: Floats, band: float, gap: float) -> list[tuple[int, int]]:
    """Return, for every first row, the last one up to which the angle's range is within 2·band; none twice."""
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
    """Of two rests with nothing but the last of a swing between them keep the longer: the other is a turning point."""
    kept: list[_Rest] = []
    for rest in rests:
        kept.append(rest)
        while len(kept) > 1 and np.ptp(y[kept[-2].first : kept[-1].last + 1]) < _LEAST_WAY * band:
            del kept[-2 if t[kept[-2].last] - t[kept[-2].first] < t[kept[-1].last] - t[kept[-1].first] else -1]
    return kept


def _lasting(rests: list[_Rest], t: Floats, y: Floats, band: float) -> list[_Rest]:
    """Leave out pauses: what is shorter than the rise before or after it is no rest."""
    while len(rests) > 1:
        rises = [_rough_rise(t, y, a, b, band) for a, b in pairwise(rests)]
        beside = [max(pair) for pair in pairwise([0.0, *rises, 0.0])]
        lasting = [(t[r.last] - t[r.first]) / max(rise, 1e-9) for r, rise in zip(rests, beside, strict=True)]
        if min(lasting) >= 1.0:
            break
        del rests[int(np.argmin(lasting))]
    return rests


def _rough_rise(t: Floats, y: Floats, before: _Rest, after: _Rest, band: float) -> float:
    rows = slice(before.last, after.first + 1)
    way = after.level - before.level
    if abs(way) < 2.0 * band:
        # out and back again: neither rise can be longer than half of it
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
    # what lies between frames is guessed; a spline's error where the acceleration jumps goes with the square of the
    # interval, so every second frame errs by three times as much more (Richardson 1911)
    halves = [_read(_smooth(t[k::2], y[k::2], s[k::2]), grid, levels, begun) for k in (0, 1)]
    guess = np.sqrt(np.mean([((half - figures) / 3.0) ** 2 for half in halves], axis=0))
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
    # a smoothed rise is slower than the rise: what that does to the curve again, it has done to it once
    sigma = np.sqrt(drawn.var(axis=0) + (drawn.mean(axis=0) - figures) ** 2 + guess**2)
    start, low, high, settled = figures[:4]
    gaps = np.flatnonzero(np.diff(t) > _GAP_FRAMES * frame)
    blind = [(t[g], t[g + 1]) for g in gaps]

    def told(value: float, error: float, needs: Sequence[float], whole: bool = False) -> Figure:
        ends = min(needs), max(needs)
        lost = (
            any(a < ends[1] and b > ends[0] for a, b in blind)
            if whole
            else any(a < moment < b for a, b in blind for moment in needs)
        )
        return Figure(np.nan, np.nan) if lost else Figure(float(value), float(error))

    return Response(
        start=told(start, sigma[0], [start]),
        from_angle=Figure(before.level, before.sigma),
        to_angle=Figure(after.level, after.sigma),
        rise_time=told(high - low, sigma[4], [low, high]),
        overshoot=told(figures[5], sigma[5], [high, settled, t[-1]], whole=True),
        settling_time=told(settled - start, sigma[6], [start, settled]),
        peak_speed=told(figures[7], sigma[7], [low, high], whole=True),
    )


def _smooth(t: Floats, y: Floats, s: Floats) -> UnivariateSpline:
    """Fit the smoothest spline that leaves the noise over."""
    with warnings.catch_warnings():
        # where the noise was overrated the spline stops short of it, which is well
        warnings.simplefilter("ignore", UserWarning)
        return UnivariateSpline(t, y, w=1.0 / s, s=len(t))


def _read(curve: UnivariateSpline, grid: Floats, levels: tuple[float, float], begun: float | None) -> Floats:
    """Read start, 10 %, 90 %, settled (s), rise, overshoot, settling and peak speed off a curve."""
    way = levels[1] - levels[0]
    share = (curve(grid) - levels[0]) / way
    low, high = first_crossing(grid, share, LOW), first_crossing(grid, share, HIGH)
    first = int(np.searchsorted(grid, low))
    start = begun if begun is not None else last_rise(grid[: first + 1], share[: first + 1] - SETTLED)
    settled = settling(grid, share)
    overshoot = max(0.0, float(share.max()) - 1.0)
    speed = float((np.sign(way) * curve.derivative()(grid)).max())
    return np.array([start, low, high, settled, high - low, overshoot, settled - start, speed])
