"""Rise time, overshoot and settling time of measured motion, from one rest to the next.

The figures are those of MATLAB's ``stepinfo``: rise from 10 % to 90 % of the step, overshoot beyond the final rest as a
share of the step, settling to within 2 % of the step for good. Between frames the angle is interpolated by a smoothing
spline that stays within the noise (Reinsch 1967). Each figure's uncertainty combines the propagated noise (Monte Carlo,
GUM Supplement 1) and the difference that another spline makes.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import UnivariateSpline

from anglecam.data.step_figures import HIGH, LOW, SETTLED, first_crossing, last_rise, settling
from anglecam.data.typing import Floats
from anglecam.measurement.rests import Rest, find_rests, gaps_after, resolution

_LEAST_WAY = 5.0
"""Half-widths of the band of a rest; of a smaller step between two rests, 10 % and 90 % are within the noise."""
_FEWEST = 10
"""Frames of the shortest series in which a response can be seen."""
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


def responses(time: Floats, angle: Floats, sigma: Floats, changes: Sequence[float] = ()) -> tuple[Response, ...]:
    """Find every motion from one rest to another, and its figures.

    A rest is an interval in which the angle stays in a narrow band, which no motion beside it goes on through
    (`anglecam.measurement.rests`), and which lasts at least as long as the rises before and after it. A motion that
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
    if len(t) < _FEWEST:
        return ()
    s = np.where(np.isfinite(s), s, _roughness(y))
    band, found = resolution(y, s), []
    for before, after in pairwise(find_rests(t, y, s)):
        # with a delay the angle stays at rest for a while after the change that moves it
        away = np.abs(y[before.last : after.first + 1] - before.level) > 2.0 * band
        leaves = t[before.last + int(np.argmax(away))]
        causes = [c for c in changes if t[before.first] <= c <= leaves]
        again = any(leaves < c < t[after.first] for c in changes)
        if abs(after.level - before.level) >= _LEAST_WAY * band and not again and not _is_excursion(y, before, after):
            found.append(_response(t, y, s, before, after, causes[-1] if causes else None))
    return tuple(found)


def _is_excursion(y: Floats, before: Rest, after: Rest) -> bool:
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


def _response(t: Floats, y: Floats, s: Floats, before: Rest, after: Rest, begun: float | None) -> Response:
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
    blind = [(t[g], t[g + 1]) for g in gaps_after(t)]

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
