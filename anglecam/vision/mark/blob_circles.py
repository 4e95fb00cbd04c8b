"""Circles through two or three blobs that are drawn at random and may be one object (Fischler & Bolles 1981)."""

from __future__ import annotations

from functools import lru_cache
from itertools import combinations
from math import dist

import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats
from anglecam.vision.mark.blobs import Blobs
from anglecam.vision.pivot.circle import circle_through

TOLERANCE_PX = 2.0
"""Distance from the circle within which a blob belongs to the track; coarse blobs are located this well."""
MOVED_PX = 4.0
"""A path with a smaller extent counts as rest."""
_HINT_PX = 30.0
"""Largest error of a hint at the pivot."""
_LEAST_RADIUS_PX = 20.0
_TRIALS = 600
_PAIR_EVERY = 4
"""Every fourth draw is of two blobs, the others are of three."""
_NONE = -1
_ALIKE_AREA, _ALIKE_CONTRAST = 1.6, 1.5
"""Largest ratios between the blobs of a draw."""


def draw_blobs(blobs: Blobs, through: NDArray[np.intp] | None) -> list[NDArray[np.int64]]:
    """Draw blobs of different pictures that are alike in size and contrast.

    Parameters
    ----------
    blobs : Blobs
        The blobs of all pictures.
    through : ndarray, optional
        Indices of blobs of which every draw contains one.

    Returns
    -------
    list of ndarray
        (2,) or (3,) indices of each draw, without repetitions; empty where fewer than two poses are distinct.
    """
    poses = _distinct_poses(blobs)
    if len(poses) < 2:
        return []
    fixed = np.empty(0, np.intp) if through is None else through
    places, first = _draws(len(poses), len(fixed))
    drawn = poses[places]
    if len(fixed):
        drawn[:, 0] = fixed[first]
    drawn[places[:, 2] < 0, 2] = _NONE
    _, new = np.unique(np.sort(drawn, axis=1), axis=0, return_index=True)
    drawn = drawn[np.sort(new)]
    pair = drawn[:, 2] == _NONE
    drawn[pair, 2] = drawn[pair, 1]
    frames, areas, contrasts = blobs.frame[drawn], blobs.area[drawn], blobs.contrast[drawn]
    usable = (frames[:, 0] != frames[:, 1]) & (frames[:, 0] != frames[:, 2])
    usable &= pair | (frames[:, 1] != frames[:, 2])
    usable &= areas.max(axis=1) <= _ALIKE_AREA * areas.min(axis=1)
    usable &= contrasts.max(axis=1) <= _ALIKE_CONTRAST * contrasts.min(axis=1)
    return [draw[: 2 if two else 3] for draw, two in zip(drawn[usable], pair[usable].tolist(), strict=True)]


@lru_cache(maxsize=64)
def _draws(count: int, fixed: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the places (n, 3) of drawn poses among ``count``, and those (n,) of one blob among ``fixed``.

    A draw of two has no third place. The same numbers are drawn for every clip.
    """
    rng = np.random.default_rng(0)
    places, first = np.full((_TRIALS, 3), _NONE), np.zeros(_TRIALS, np.int64)
    for trial in range(_TRIALS):
        # A clip that hardly moves has only two distinct poses.
        size = min(2 + (trial % _PAIR_EVERY > 0), count)
        some = rng.choice(count, size=size, replace=False)
        places[trial, :size] = some
        if fixed:
            first[trial] = rng.choice(fixed)
    return places, first


def _distinct_poses(blobs: Blobs) -> NDArray[np.int64]:
    """Pick one blob of each place and size, so that a long rest does not outweigh a short motion."""
    key = np.column_stack([np.round(blobs.plane_px / MOVED_PX), np.round(np.log(blobs.area) / 0.3)])
    _, first = np.unique(key, axis=0, return_index=True)
    return first


def circle_of(places_px: Floats, hint: Floats | None, longest_px: float) -> tuple[Floats, float] | None:
    """Fit a circle to two or three places; where they do not determine the radius, take the hint as its centre.

    Parameters
    ----------
    places_px : ndarray
        (2, 2) or (3, 2) px.
    hint : ndarray, optional
        (2,) approximate centre, px.
    longest_px : float
        Largest radius.

    Returns
    -------
    tuple of ndarray and float, or None
        Centre and radius, px; ``None`` where two places are one, or no circle agrees with the hint.
    """
    p = places_px
    if min(dist(*ends) for ends in combinations(p.tolist(), 2)) < MOVED_PX / 2.0:
        return None
    if len(p) == 3:
        centre, radius = circle_through(p)
        if hint is None or np.hypot(*(centre - hint)) <= _HINT_PX:
            return (centre, radius) if _LEAST_RADIUS_PX < radius < longest_px else None
    if hint is not None:
        distance = np.hypot(*(p - hint).T)
        # An error e of the hint changes the distance by up to e times the angle between the places.
        open_px = TOLERANCE_PX + _HINT_PX * float(np.hypot(*np.ptp(p, axis=0))) / max(float(distance.min()), 1.0)
        return (hint, float(np.median(distance))) if np.ptp(distance) < open_px else None
    if len(p) == 3:
        return None
    # Two places and no hint: on so short a path, any circle through them will do to collect further blobs.
    way = p[1] - p[0]
    return p.mean(axis=0) + 5.0 * np.array([-way[1], way[0]]), 5.0 * float(np.hypot(*way))
