"""Which of a frame's regions is the mouth, and whether all of it is in sight.

The mouth keeps its distance from the pivot, its size and, in a frame that turns with it, its shape. What departs
from the clip's own norm is partly hidden or has grown together with something else.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anglecam.data.series import OK
from anglecam.data.typing import Floats
from anglecam.vision.mark.search import FoundMark
from anglecam.vision.mark.segment import Region
from anglecam.vision.pivot.circle import Circle, fit_circle
from anglecam.vision.status import AMBIGUOUS, NO_MARK, OCCLUDED

_COARSE_PX = 6.0
"""ResidualTest about the coarse circle."""
_LEAST_GATE_PX = 1.5
_SPOT_PX = 3.0
"""A region that comes back within this distance while the mouth is elsewhere is part of the scenery."""
_SCATTER_TOLD = 8
"""Places from which on a circle's scatter says how far off it the mouth may be: through four any circle fits."""
_ROBUST = 6.0
"""Robust standard deviations at which size, shape or distance are off the clip's norm."""
_LEAST_SHARE = 0.04
"""Of the mouth's area: where this much is hidden, the centroid moves by up to that share of the mouth's half length,
some tenths of a pixel."""
_FAST_PX = 4.0
"""Way from frame to frame that can smear a mouth beyond recognition."""
_ONE_POSE = 0.05
"""Turns closer than this are one pose to light and perspective, rad."""
_LEAST_OFF_PX = 0.4
"""A distance from the circle that no whole mouth shows."""


@dataclass(frozen=True)
class MarkTrack:
    """The mouth through a clip; tuples with an entry a frame."""

    regions: tuple[Region | None, ...]
    """The mouth's region where ``status`` is ``ok`` or ``occluded``."""
    status: tuple[str, ...]
    """``ok``, ``no_mouth``, ``occluded`` or ``ambiguous``."""
    circle: Circle | None
    """Fitted to the places in the frames that are ok; ``None`` where the mouth is at rest."""
    smeared: NDArray[np.bool_]
    """(n,) frames that are ``occluded`` by the looks of the mouth, but it moves so fast that this may be its blur."""


def follow_mark(candidates: Sequence[Sequence[Region]], time: Floats, found: FoundMark) -> MarkTrack:
    """Choose the mouth's region in every frame.

    Parameters
    ----------
    candidates : sequence of sequence of Region
        The regions of each frame, none where a frame has no image.
    time : ndarray
        (n,) s.
    found : Found
        What the search knows: size, and circle or place.

    Returns
    -------
    Track
        A status for every frame, and the circle.
    """
    gate, centre, radius = _COARSE_PX, *(found.circle or (found.place_px, 0.0))
    likely = [_near(regions, centre, radius, gate, 0.5, 2.0, found.area_px2) for regions in candidates]
    single = [r[0] for r in likely if len(r) == 1 and r[0].whole] or [q for r in likely for q in r]
    if not single:
        return MarkTrack((None,) * len(candidates), (NO_MARK,) * len(candidates), None, np.zeros(len(candidates), bool))
    area = float(np.median([r.area_px2 for r in single]))
    if found.circle is not None:
        circle = fit_circle(np.array([r.centre_px for r in single]), start=found.circle)
        if circle is not None and circle.fits.sum() >= _SCATTER_TOLD:
            centre, radius = circle.centre_px, circle.radius_px
            gate = max(_LEAST_GATE_PX, _ROBUST * circle.scatter_px)
    chosen, status = _choose(candidates, time, centre, radius, gate, area)
    circle = None
    for _ in range(2):
        ok = [i for i, s in enumerate(status) if s == OK]
        if found.circle is not None and len(ok) >= 4:
            circle = fit_circle(np.array([chosen[i].centre_px for i in ok]), start=(centre, radius))  # type: ignore[union-attr]
            if circle is not None:
                centre, radius = circle.centre_px, circle.radius_px
        _mark_hidden(chosen, status, time, centre, radius, circle)
    smeared = _smeared(chosen, status, time)
    _join_hidden(status)
    return MarkTrack(tuple(chosen), tuple(status), circle, smeared)


def _near(
    regions: Sequence[Region], centre: Floats, radius: float, gate: float, least: float, most: float, area: float
) -> list[Region]:
    return [
        r
        for r in regions
        if abs(np.hypot(*(r.centre_px - centre)) - radius) < gate and least * area < r.area_px2 < most * area
    ]


def _choose(
    candidates: Sequence[Sequence[Region]], time: Floats, centre: Floats, radius: float, gate: float, area: float
) -> tuple[list[Region | None], list[str]]:
    """Take the one region on the circle; of several, the one that is no scenery and continues the motion."""
    n = len(candidates)
    # A hidden part pulls the centroid off the circle by up to a part of the mouth's own size.
    wide = gate + 0.5 * np.sqrt(area)
    likely = [_near(regions, centre, radius, wide, 0.2, 3.0, area) for regions in candidates]
    good = [_near(regions, centre, radius, gate, 0.7, 1.4, area) for regions in candidates]
    sure = np.array([len(g) == 1 and len(k) == 1 for g, k in zip(good, likely, strict=True)])
    known = {int(i): good[i][0].centre_px for i in np.flatnonzero(sure)}
    scenery = _scenery(candidates, known)
    chosen: list[Region | None] = [None] * n
    status = [NO_MARK] * n
    for i in range(n):
        rest = [r for r in likely[i] if not _is_scenery(r, scenery)] if len(likely[i]) > 1 else likely[i]
        if not rest:
            continue
        if len(rest) == 1:
            chosen[i], status[i] = rest[0], OK
            continue
        expected = _interpolate(known, time, i)
        if expected is None:
            status[i] = AMBIGUOUS
            continue
        away = np.array([np.hypot(*(r.centre_px - expected)) for r in rest])
        first, second = np.argsort(away)[:2]
        alike = 0.5 < rest[second].area_px2 / rest[first].area_px2 < 2.0
        if alike and away[first] > 0.5 * away[second]:
            status[i] = AMBIGUOUS
        else:
            chosen[i], status[i] = rest[first], OK
    return chosen, status


def _scenery(candidates: Sequence[Sequence[Region]], known: dict[int, Floats]) -> list[tuple[Floats, float]]:
    """List places and sizes of regions that stay where they are while the mouth is elsewhere."""
    spots: list[tuple[Floats, float, int]] = []
    for i, mouth in known.items():
        for r in candidates[i]:
            if np.hypot(*(r.centre_px - mouth)) < _SPOT_PX:
                continue
            for k, (place, size, count) in enumerate(spots):
                if np.hypot(*(r.centre_px - place)) < _SPOT_PX and 0.7 < r.area_px2 / size < 1.4:
                    spots[k] = (place, size, count + 1)
                    break
            else:
                if len(spots) < 200:
                    spots.append((r.centre_px, r.area_px2, 1))
    return [(place, size) for place, size, count in spots if count >= max(3, 0.2 * len(known))]


def _is_scenery(region: Region, scenery: list[tuple[Floats, float]]) -> bool:
    return any(
        np.hypot(*(region.centre_px - place)) < _SPOT_PX and 0.7 < region.area_px2 / size < 1.4
        for place, size in scenery
    )


def _interpolate(known: dict[int, Floats], time: Floats, i: int) -> Floats | None:
    frames = np.array(sorted(known))
    if not len(frames):
        return None
    after = int(np.searchsorted(frames, i))
    ends = [int(frames[k]) for k in (after - 1, after) if 0 <= k < len(frames)]
    places = np.array([known[k] for k in ends])
    return np.array([np.interp(time[i], time[ends], places[:, axis]) for axis in (0, 1)])


def _mark_hidden(
    chosen: Sequence[Region | None],
    status: list[str],
    time: Floats,
    centre: Floats,
    radius: float,
    circle: Circle | None,
) -> None:
    """Mark the frames in which size, shape or distance are off what the clip's other frames agree on."""
    rows = [i for i, r in enumerate(chosen) if r is not None and status[i] in (OK, OCCLUDED)]
    if not rows:
        return
    regions = [chosen[i] for i in rows]
    place = np.array([r.centre_px for r in regions])  # type: ignore[union-attr]
    area = np.array([r.area_px2 for r in regions])  # type: ignore[union-attr]
    whole = np.array([r.whole for r in regions])  # type: ignore[union-attr]
    arm = place - centre if circle is not None else np.ones_like(place)
    turn = np.arctan2(arm[:, 1], arm[:, 0])
    out = np.column_stack([np.cos(turn), np.sin(turn)])
    along = np.column_stack([-out[:, 1], out[:, 0]])
    M = np.array([r.moments_px2 for r in regions])  # type: ignore[union-attr]
    radial = np.einsum("ni,nij,nj->n", out, M, out)
    tangential = np.einsum("ni,nij,nj->n", along, M, along)
    typical = float(np.median(area))
    pose = np.unwrap(turn) if circle is not None else np.zeros(len(turn))
    # Motion during the exposure draws the mouth out along its path by a length that goes with the speed.
    blur = _speed(place, time[rows]) ** 2
    off = np.zeros(len(rows), bool)
    # The second moment goes with the square of the length.
    for value, least in ((area, _LEAST_SHARE), (radial, 2.0 * _LEAST_SHARE), (tangential, 2.0 * _LEAST_SHARE)):
        departure = _departure(value, pose, blur)
        spread = 1.4826 * float(np.median(np.abs(departure - np.median(departure))))
        off |= np.abs(departure) > max(least * float(np.median(value)), _ROBUST * spread)
    if circle is not None:
        # A mouth that really leaves the circle (a loose thread, a shaking rig) keeps its size; one that only seems
        # to has lost or gained an area that can have moved its centroid so far.
        d = np.abs(np.hypot(*arm.T) - radius)
        moved = np.abs(_departure(area, pose, blur)) / typical * 2.0 * np.sqrt(np.maximum(radial, tangential))
        off |= (d > max(_ROBUST * circle.scatter_px, _LEAST_OFF_PX)) & (moved > 0.5 * d)
    for i, bad in zip(rows, off | ~whole, strict=True):
        status[i] = OCCLUDED if bad else OK


def _smeared(chosen: Sequence[Region | None], status: Sequence[str], time: Floats) -> NDArray[np.bool_]:
    """Tell which whole but ill-shaped mouths move fast."""
    found = np.zeros(len(chosen), bool)
    rows = [i for i, r in enumerate(chosen) if r is not None and status[i] in (OK, OCCLUDED)]
    if not rows:
        return found
    way = _speed(np.array([chosen[i].centre_px for i in rows]), time[rows])  # type: ignore[union-attr]
    for i, px in zip(rows, way, strict=True):
        region = chosen[i]
        found[i] = status[i] == OCCLUDED and px > _FAST_PX and region is not None and region.whole
    return found


def _join_hidden(status: list[str]) -> None:
    """Call a mouth that is partly hidden before or after it is gone hidden in between."""
    for order in (range(1, len(status)), range(len(status) - 2, -1, -1)):
        for i in order:
            if status[i] == NO_MARK and status[i - order.step] == OCCLUDED:
                status[i] = OCCLUDED


def _departure(value: Floats, pose: Floats, blur: Floats) -> Floats:
    """Return the departure of a value from its robust trend: quadratic in pose (light, perspective), linear in blur.

    Every pose counts alike: after one step from rest to rest most frames are in one of two, and the other is no
    outlier.
    """
    x = pose - np.median(pose)
    if np.ptp(x) <= _ONE_POSE or len(x) < 12:
        return value - np.median(value)
    A = np.column_stack([np.ones_like(x), x, x**2, blur])
    _, place, count = np.unique(np.round(x / _ONE_POSE), return_inverse=True, return_counts=True)
    weight = 1.0 / np.sqrt(count[place])
    keep = np.ones(len(x), bool)
    rest = np.zeros(len(x))
    for _ in range(6):
        known = weight * keep
        rest = value - A @ np.linalg.lstsq(known[:, None] * A, known * value, rcond=None)[0]
        spread = 1.4826 * float(np.median(np.abs(rest - np.median(rest))))
        keep = np.abs(rest - np.median(rest)) <= 3.0 * max(spread, 1e-9)
    return rest


def _speed(place: Floats, time: Floats) -> Floats:
    """Return the way between a frame and its faster neighbour, px per median frame interval."""
    if len(place) < 2:
        return np.zeros(len(place))
    step = np.median(np.diff(time))
    speed = np.hypot(*np.diff(place, axis=0).T) / np.diff(time) * step
    return np.maximum(np.append(speed, 0.0), np.insert(speed, 0, 0.0))
