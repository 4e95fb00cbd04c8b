"""Follow the mark: which of a frame's regions is the mark, and whether all of it is visible.

The mark keeps its distance from the pivot, its size and, in a frame of reference that rotates with it, its shape. A
region that departs from the clip's norm is partly hidden or merged with something else.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anglecam.data.series import OK
from anglecam.data.typing import Floats
from anglecam.vision.mark.found_mark import FoundMark
from anglecam.vision.mark.segment import Region
from anglecam.vision.pivot.circle import Circle, fit_circle
from anglecam.vision.status import AMBIGUOUS, NO_MARK, OCCLUDED

COARSE_PX = 6.0
"""Largest distance of the mark from the coarse circle, px."""
_MIN_TOLERANCE_PX = 1.5
"""Least tolerance around the fitted circle, px."""
_SPOT_PX = 3.0
"""A region that is seen again within this distance while the mark is elsewhere belongs to the scenery."""
_MIN_FOR_SCATTER = 8
"""Fewest places from which the scatter around a fitted circle limits the mark's distance. Through four places a circle
always fits closely."""
_ROBUST = 6.0
"""Robust standard deviations beyond which size, shape or distance depart from the clip's norm."""
_HIDDEN_SHARE = 0.04
"""Share of the mark's area. Where this much is hidden, the centroid moves by up to that share of the mark's half
length, some tenths of a pixel."""
_FAST_PX = 4.0
"""Displacement from frame to frame, px, that can smear a mark beyond recognition."""
_POSE_WIDTH = 0.05
"""Angles closer than this, rad, count as one pose: light and perspective are the same."""
_MIN_OFF_PX = 0.4
"""Largest distance from the circle, px, that a wholly visible mark shows."""


@dataclass(frozen=True)
class MarkTrack:
    """The mark through a clip; tuples with one entry for each frame."""

    regions: tuple[Region | None, ...]
    """The mark's region where ``status`` is ``ok`` or ``occluded``."""
    status: tuple[str, ...]
    """``ok``, ``no_mouth``, ``occluded`` or ``ambiguous``."""
    circle: Circle | None
    """Fitted to the places in the frames that are ok; ``None`` where the mark is at rest."""
    smeared: NDArray[np.bool_]
    """(n,) frames with status ``occluded`` in which the mark moves so fast that motion blur may explain its shape."""


def follow_mark(candidates: Sequence[Sequence[Region]], time: Floats, found: FoundMark) -> MarkTrack:
    """Choose the mark's region in every frame.

    Parameters
    ----------
    candidates : sequence of sequence of Region
        The regions of each frame, in the plane of motion; none where a frame has no image.
    time : ndarray
        (n,) s.
    found : FoundMark
        Size, and circle or place, from the search.

    Returns
    -------
    MarkTrack
        A status for every frame, and the circle.
    """
    tolerance, centre, radius = COARSE_PX, *(found.circle or (found.place_px, 0.0))
    likely = [_near(regions, centre, radius, tolerance, 0.5, 2.0, found.area_px2) for regions in candidates]
    single = [r[0] for r in likely if len(r) == 1 and r[0].whole] or [q for r in likely for q in r]
    if not single:
        return MarkTrack((None,) * len(candidates), (NO_MARK,) * len(candidates), None, np.zeros(len(candidates), bool))
    area = float(np.median([r.area_px2 for r in single]))
    if found.circle is not None:
        circle = fit_circle(np.array([r.centre_px for r in single]), start=found.circle)
        if circle is not None and circle.fits.sum() >= _MIN_FOR_SCATTER:
            centre, radius = circle.centre_px, circle.radius_px
            tolerance = max(_MIN_TOLERANCE_PX, _ROBUST * circle.scatter_px)
    chosen, status = _choose(candidates, time, centre, radius, tolerance, area)
    circle = None
    for _ in range(2):
        ok = [i for i, s in enumerate(status) if s == OK]
        if found.circle is not None and len(ok) >= 4:
            circle = fit_circle(np.array([chosen[i].centre_px for i in ok]), start=(centre, radius))  # type: ignore[union-attr]
            if circle is not None:
                centre, radius = circle.centre_px, circle.radius_px
        _set_occluded(chosen, status, time, centre, radius, circle)
    smeared = _smeared(chosen, status, time)
    _join_occluded(status)
    return MarkTrack(tuple(chosen), tuple(status), circle, smeared)


def _near(
    regions: Sequence[Region], centre: Floats, radius: float, tolerance: float, least: float, most: float, area: float
) -> list[Region]:
    return [
        r
        for r in regions
        if abs(np.hypot(*(r.centre_px - centre)) - radius) < tolerance and least * area < r.area_px2 < most * area
    ]


def _choose(
    candidates: Sequence[Sequence[Region]], time: Floats, centre: Floats, radius: float, tolerance: float, area: float
) -> tuple[list[Region | None], list[str]]:
    """Choose the only region on the circle; of several, the one that is not scenery and continues the motion."""
    n = len(candidates)
    # A hidden part pulls the centroid off the circle by up to a part of the mark's own size.
    wide = tolerance + 0.5 * np.sqrt(area)
    likely = [_near(regions, centre, radius, wide, 0.2, 3.0, area) for regions in candidates]
    good = [_near(regions, centre, radius, tolerance, 0.7, 1.4, area) for regions in candidates]
    certain = np.array([len(g) == 1 and len(k) == 1 for g, k in zip(good, likely, strict=True)])
    known = {int(i): good[i][0].centre_px for i in np.flatnonzero(certain)}
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
    """List places and sizes of regions that stay in place while the mark is elsewhere."""
    spots: list[tuple[Floats, float, int]] = []
    for i, mark in known.items():
        for r in candidates[i]:
            if np.hypot(*(r.centre_px - mark)) < _SPOT_PX:
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
    """Interpolate the mark's place (2,) in frame i between the nearest frames in which it is known."""
    frames = np.array(sorted(known))
    if not len(frames):
        return None
    after = int(np.searchsorted(frames, i))
    ends = [int(frames[k]) for k in (after - 1, after) if 0 <= k < len(frames)]
    places = np.array([known[k] for k in ends])
    return np.array([np.interp(time[i], time[ends], places[:, axis]) for axis in (0, 1)])


def _set_occluded(
    chosen: Sequence[Region | None],
    status: list[str],
    time: Floats,
    centre: Floats,
    radius: float,
    circle: Circle | None,
) -> None:
    """Set the status of frames whose size, shape or distance departs from the norm of the clip's other frames."""
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
    # Motion during the exposure stretches the mark along its path by a length proportional to the speed, so its
    # second moment grows with the square of the speed.
    blur = _speed(place, time[rows]) ** 2
    off = np.zeros(len(rows), bool)
    # Second moments scale with the square of the length, so their least departure is twice that of the area.
    for value, least in ((area, _HIDDEN_SHARE), (radial, 2.0 * _HIDDEN_SHARE), (tangential, 2.0 * _HIDDEN_SHARE)):
        departure = _departure(value, pose, blur)
        spread = 1.4826 * float(np.median(np.abs(departure - np.median(departure))))
        off |= np.abs(departure) > max(least * float(np.median(value)), _ROBUST * spread)
    if circle is not None:
        # A mark that really leaves the circle (a loose thread, a shaking rig) keeps its size. A mark that only
        # appears to leave it has lost or gained an area large enough to move its centroid that far.
        d = np.abs(np.hypot(*arm.T) - radius)
        moved = np.abs(_departure(area, pose, blur)) / typical * 2.0 * np.sqrt(np.maximum(radial, tangential))
        off |= (d > max(_ROBUST * circle.scatter_px, _MIN_OFF_PX)) & (moved > 0.5 * d)
    for i, bad in zip(rows, off | ~whole, strict=True):
        status[i] = OCCLUDED if bad else OK


def _smeared(chosen: Sequence[Region | None], status: Sequence[str], time: Floats) -> NDArray[np.bool_]:
    """Return the frames (n,) in which an occluded mark is whole and moves fast."""
    found = np.zeros(len(chosen), bool)
    rows = [i for i, r in enumerate(chosen) if r is not None and status[i] in (OK, OCCLUDED)]
    if not rows:
        return found
    way = _speed(np.array([chosen[i].centre_px for i in rows]), time[rows])  # type: ignore[union-attr]
    for i, px in zip(rows, way, strict=True):
        region = chosen[i]
        found[i] = status[i] == OCCLUDED and px > _FAST_PX and region is not None and region.whole
    return found


def _join_occluded(status: list[str]) -> None:
    """Change ``no_mouth`` to ``occluded`` in runs of frames before or after which the mark is partly hidden."""
    for order in (range(1, len(status)), range(len(status) - 2, -1, -1)):
        for i in order:
            if status[i] == NO_MARK and status[i - order.step] == OCCLUDED:
                status[i] = OCCLUDED


def _departure(value: Floats, pose: Floats, blur: Floats) -> Floats:
    """Return the departure of a value from its robust trend: quadratic in pose (light, perspective), linear in blur.

    Every pose has the same weight. After a single step from rest to rest most frames are in one of two poses, and the
    less frequent pose must not be treated as an outlier.
    """
    x = pose - np.median(pose)
    if np.ptp(x) <= _POSE_WIDTH or len(x) < 12:
        return value - np.median(value)
    A = np.column_stack([np.ones_like(x), x, x**2, blur])
    _, place, count = np.unique(np.round(x / _POSE_WIDTH), return_inverse=True, return_counts=True)
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
    """Return the displacement (n,) between each frame and its faster neighbour, px per median frame interval."""
    if len(place) < 2:
        return np.zeros(len(place))
    step = np.median(np.diff(time))
    speed = np.hypot(*np.diff(place, axis=0).T) / np.diff(time) * step
    return np.maximum(np.append(speed, 0.0), np.insert(speed, 0, 0.0))
