"""Circles through blobs drawn at random, and how well the blobs of many pictures travel on each (RANSAC).

Two or three poses of one blob determine a circle. All blobs of that size and contrast that lie on it, at most one of
each picture, are then taken for the same object (Fischler & Bolles 1981).
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from anglecam.data.typing import Floats
from anglecam.vision.mark.blobs import Blobs
from anglecam.vision.pivot.circle import circumcircles

MOVED_PX = 4.0
"""A path with a smaller extent counts as rest."""
_TRIALS = 600
"""Draws of two or three poses; most are of blobs that differ, or of one picture."""
_ONE_IN = 4
"""Of the draws, one in so many is of two poses."""
_ALIKE_AREA, _ALIKE_CONTRAST = 1.6, 1.5
"""Largest ratios between the drawn blobs."""
_HINT_PX = 30.0
"""Largest error of a hint at the pivot."""
_LEAST_RADIUS_PX = 20.0
_TOLERANCE_PX = 2.0
"""Distance from the circle within which a blob belongs to the track; coarse blobs are located this well."""
_UNLIKE = 0.6
"""Largest difference of a blob from the drawn ones: the logarithms of the ratios of areas and of contrasts, added."""
_LEAST_CONTRAST = 1e-3
_FEWEST = 3
"""A track has at least as many blobs."""
_BENT_PX = 0.5
"""RMS distance from the best straight line, px, that makes a path distinctly curved."""
_STRAIGHT_WEIGHT = 0.1
"""Score of a straight path relative to a curved one. It is not zero, because a mark that hardly moves has no curved
path."""


def draw_circles(
    blobs: Blobs, hint: Floats | None, longest_px: float, through: NDArray[np.intp] | None
) -> tuple[Floats, Floats]:
    """Draw blobs of one size and contrast from two or three pictures, and return the circles on which they lie.

    Parameters
    ----------
    blobs : Blobs
        The blobs of all pictures.
    hint : ndarray, optional
        (2,) approximate centre in the plane of motion, px.
    longest_px : float
        Largest radius.
    through : ndarray, optional
        Indices of blobs of which every draw contains one.

    Returns
    -------
    circles : ndarray
        (n, 3) centre and radius, px, in the order in which they were drawn.
    typical : ndarray
        (n, 2) median area, px², and contrast of the drawn blobs.
    """
    poses = _distinct_poses(blobs)
    rng = np.random.default_rng(0)
    draws: dict[int, list[NDArray[np.int64]]] = {2: [], 3: []}
    trials: dict[int, list[int]] = {2: [], 3: []}
    for trial in range(_TRIALS if len(poses) >= 2 else 0):
        # a clip that hardly moves has only two distinct poses
        some = rng.choice(poses, size=min(2 + (trial % _ONE_IN > 0), len(poses)), replace=False)
        if through is not None and len(through):
            some[0] = rng.choice(through)
        draws[len(some)].append(some)
        trials[len(some)].append(trial)
    circles, typical, order = [np.empty((0, 3))], [np.empty((0, 2))], [np.empty(0, int)]
    for size, of_size in draws.items():
        if not of_size:
            continue
        drawn, first = np.unique(np.sort(of_size, axis=1), axis=0, return_index=True)
        trial_of = np.array(trials[size])[first]
        alike = _alike(blobs, drawn)
        drawn, trial_of = drawn[alike], trial_of[alike]
        found = _circles(blobs.plane_px[drawn], hint, longest_px)
        exist = np.isfinite(found).all(axis=1)
        circles.append(found[exist])
        typical.append(np.median([blobs.area[drawn[exist]], blobs.contrast[drawn[exist]]], axis=2).T)
        order.append(trial_of[exist])
    as_drawn = np.argsort(np.concatenate(order))
    return np.concatenate(circles)[as_drawn], np.concatenate(typical)[as_drawn]


def _distinct_poses(blobs: Blobs) -> NDArray[np.int64]:
    """Pick one blob of each place and size, so that a long rest does not outweigh a short motion."""
    key = np.column_stack([np.round(blobs.plane_px / MOVED_PX), np.round(np.log(blobs.area) / 0.3)])
    _, first = np.unique(key, axis=0, return_index=True)
    return first


def _alike(blobs: Blobs, drawn: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return which draws (n, poses) are of different pictures, and of blobs that may be one object."""
    frames = np.sort(blobs.frame[drawn], axis=1)
    area, contrast = np.sort(blobs.area[drawn], axis=1), np.sort(blobs.contrast[drawn], axis=1)
    alike = (area[:, -1] <= _ALIKE_AREA * area[:, 0]) & (contrast[:, -1] <= _ALIKE_CONTRAST * contrast[:, 0])
    return np.asarray(alike & (np.diff(frames, axis=1) > 0).all(axis=1))


def _circles(places: Floats, hint: Floats | None, longest_px: float) -> Floats:
    """Return circles (n, 3) through places (n, 2 or 3, 2); where they do not determine it, the hint is the centre.

    NaN where there is none.
    """
    apart = np.hypot(*(places - np.roll(places, 1, axis=1)).transpose(2, 0, 1))
    if places.shape[1] == 3:
        found = circumcircles(places)
        usable = (found[:, 2] > _LEAST_RADIUS_PX) & (found[:, 2] < longest_px)
        found = np.where(usable[:, None], found, np.nan)
    else:
        # On so short a path, any circle through two places will do to collect further blobs.
        way = places[:, 1] - places[:, 0]
        middle = places.mean(axis=1) + 5.0 * np.column_stack([-way[:, 1], way[:, 0]])
        found = np.column_stack([middle, 5.0 * np.hypot(*way.T)])
    if hint is not None:
        distance = np.hypot(*(places - hint).transpose(2, 0, 1))
        # An error e of the hint changes the distance by up to e times the angle between the places.
        open_px = _TOLERANCE_PX + _HINT_PX * np.hypot(*np.ptp(places, axis=1).T) / np.maximum(distance.min(axis=1), 1.0)
        about = np.column_stack([np.broadcast_to(hint, (len(places), 2)), np.median(distance, axis=1)])
        about = np.where((np.ptp(distance, axis=1) < open_px)[:, None], about, np.nan)
        near = np.hypot(*(circumcircles(places)[:, :2] - hint).T) <= _HINT_PX if places.shape[1] == 3 else False
        found = np.where(np.broadcast_to(near, len(places))[:, None], found, about)
    return np.asarray(np.where((apart.min(axis=1) >= MOVED_PX / 2.0)[:, None], found, np.nan))


def collect_on_circles(
    blobs: Blobs, pictures: int, circles: Floats, typical: Floats
) -> tuple[Floats, NDArray[np.int64]]:
    """Take from each picture the blob that lies on the circle and is most like the typical one; score each circle.

    Parameters
    ----------
    blobs : Blobs
        The blobs of all pictures.
    pictures : int
        Their number.
    circles, typical : ndarray
        From `draw_circles`.

    Returns
    -------
    scores : ndarray
        (n,) larger is more like a mark; 0 where too few blobs lie on the circle, or they do not move.
    members : ndarray
        (n, pictures) indices of the blobs; -1 where a picture shows none.
    """
    log_contrast = np.log(np.maximum(blobs.contrast, _LEAST_CONTRAST))
    return _collect(
        blobs.plane_px, blobs.frame, blobs.area, blobs.contrast, log_contrast, circles, np.log(typical), pictures
    )


@njit(cache=True, nogil=True)
def _collect(places, frames, areas, contrasts, log_contrasts, circles, log_typical, pictures):  # type: ignore[no-untyped-def]
    scores = np.zeros(len(circles))
    members = np.full((len(circles), pictures), -1)
    log_areas = np.log(areas)
    unlikeness, off = np.empty(pictures), np.empty(pictures)
    for c in range(len(circles)):
        x, y, radius = circles[c]
        unlikeness[:] = np.inf
        for k in range(len(places)):
            away = abs(np.hypot(places[k, 0] - x, places[k, 1] - y) - radius)
            if away < _TOLERANCE_PX:
                unlike = abs(log_areas[k] - log_typical[c, 0]) + abs(log_contrasts[k] - log_typical[c, 1])
                total = unlike + away / _TOLERANCE_PX
                t = frames[k]
                if unlike < _UNLIKE and total < unlikeness[t]:
                    unlikeness[t], off[t], members[c, t] = total, away, k
        taken = members[c][members[c] >= 0]
        if len(taken) < _FEWEST:
            continue
        spread = np.mean((off[members[c] >= 0] / _TOLERANCE_PX) ** 2)
        path = places[taken]
        across, down = path[:, 0], path[:, 1]
        extent = np.hypot(across.max() - across.min(), down.max() - down.min())
        if extent < MOVED_PX:
            continue
        # Motion to and fro on a straight line shows no centre of rotation: the smaller eigenvalue of the covariance is
        # the mean squared distance from the line.
        n = len(taken) - 1.0
        xx, yy = np.sum((across - across.mean()) ** 2) / n, np.sum((down - down.mean()) ** 2) / n
        xy = np.sum((across - across.mean()) * (down - down.mean())) / n
        off_line2 = max((xx + yy) / 2.0 - np.hypot((xx - yy) / 2.0, xy), 0.0)
        bent = 1.0 - np.exp(-off_line2 / _BENT_PX**2)
        seen = len(taken) / pictures
        constancy = np.exp(-4.0 * np.std(log_areas[taken]))
        travel = 1.0 - np.exp(-extent / 10.0)
        size = np.median(areas[taken])
        of_blobs = seen**2 * np.median(contrasts[taken]) * constancy * size**0.25 * (0.1 + travel)
        scores[c] = of_blobs * np.exp(-spread) * (_STRAIGHT_WEIGHT + (1.0 - _STRAIGHT_WEIGHT) * bent)
    return scores, members
