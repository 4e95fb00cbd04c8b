"""Proposals from features that move together as one rigid body.

Features that are recognised at any rotation (SIFT, Lowe, IJCV 60, 2004) are matched between a few reference frames and
all others. Matches that move and agree on one rigid motion (RANSAC, Fischler and Bolles, CACM 24, 1981) show a body;
its other features are those that follow it in most frames. A frame in which a body is not recognised from one reference
is reached through another.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from anglecam.engine.proposals.common_centre import (
    Complexes,
    centre_of_poses,
    fit_centre,
    proposal_of,
    turn_about,
    up,
)
from anglecam.engine.sample import Sample
from anglecam.engine.score import Proposal

_ENLARGED = 1.5
"""Features of a few pixels are found on an enlarged picture."""
_FEATURES = 300
"""Of a picture, at most."""
_CONTRAST = 0.01
"""SIFT's contrast threshold; its default, 0.04, is too high for grey on grey."""
_DISTINCT = 0.8
"""Lowe's ratio: largest distance of the best match, relative to that of the second best."""
_TOLERANCE_PX = 2.0
"""Distance within which a match follows a motion; as far has to move what is not at rest."""
_REFERENCES = 10
_BODIES = 3
"""Of a reference, at most."""
_FEWEST = 3
"""Features of a body in one other frame: two determine its motion, and a third agrees. Later two show it."""
_TRIALS = 150
_LEAST_TURN = np.radians(1.0)


@dataclass
class Group:
    """A body in the frames: its pose relative to a reference, px of the sample, imaginary axis upwards."""

    place: Complexes
    """(K,) of its middle; NaN where it is not seen."""
    direction: Complexes
    """(K,) its orientation, of length 1."""
    middle: complex
    """Of its features in the reference."""
    reach2: float
    """Mean square distance of its features from their middle, px²."""
    support: float
    """Number of matches that follow it."""


def proposals(sample: Sample) -> list[Proposal]:
    """Return a proposal for each group of features that turns, those with the most matches first."""
    points, descriptors, frame = _features(sample)
    groups: list[Group] = []
    for reference in _references(sample.pictures):
        groups += _bodies(points, descriptors, frame, reference, len(sample.pictures))
    groups.sort(key=lambda g: -g.support)
    found: list[Proposal] = []
    kept: list[Group] = []
    for group in groups:
        if any(_relation(group, other) is not None for other in kept):
            continue
        kept.append(group)
        whole = _completed(group, groups)
        spin = whole.reach2 * whole.direction
        if np.ptp(np.unwrap(np.angle(whole.direction[np.isfinite(whole.place)]))) < _LEAST_TURN:
            continue
        centre, arm = fit_centre(whole.place, spin, *centre_of_poses(whole.place, spin))
        found.append(proposal_of(sample, "features", centre, turn_about(centre, arm, whole.place, spin)))
    return found


def _features(sample: Sample) -> tuple[Complexes, NDArray[np.float32], NDArray[np.int64]]:
    """Return places (n,), descriptors (n, 128) of unit length and frames (n,) of all features."""
    sift = cv2.SIFT_create(_FEATURES, contrastThreshold=_CONTRAST)  # type: ignore[attr-defined]
    places, descriptors, frames = [np.zeros((0, 2))], [np.zeros((0, 128), np.float32)], [np.zeros(0, np.int64)]
    for k, picture in enumerate(sample.pictures):
        grey = np.clip(picture, 0, 255).astype(np.uint8)
        keypoints, described = sift.detectAndCompute(cv2.resize(grey, None, fx=_ENLARGED, fy=_ENLARGED), None)
        if described is not None:
            places.append((np.array([one.pt for one in keypoints]) + 0.5) / _ENLARGED - 0.5)
            descriptors.append(described / np.linalg.norm(described, axis=1, keepdims=True))
            frames.append(np.full(len(keypoints), k))
    return up(np.concatenate(places)), np.concatenate(descriptors), np.concatenate(frames)


def _references(pictures: NDArray[np.float32]) -> list[int]:
    """Return frames that differ from each other: each the one farthest from those before it."""
    small = np.stack([cv2.resize(p, None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA) for p in pictures])
    apart = np.abs(small - np.median(small, axis=0)).mean(axis=(1, 2))
    chosen = [int(np.argmin(apart))]
    nearest = np.full(len(small), np.inf)
    while len(chosen) < min(_REFERENCES, len(small)):
        nearest = np.minimum(nearest, np.abs(small - small[chosen[-1]]).mean(axis=(1, 2)))
        chosen.append(int(np.argmax(nearest)))
    return chosen


def _bodies(
    points: Complexes, descriptors: NDArray[np.float32], frame: NDArray[np.int64], reference: int, count: int
) -> list[Group]:
    """Return the bodies that show in a reference frame and move in others."""
    own = np.flatnonzero(frame == reference)
    if len(own) < _FEWEST:
        return []
    start = points[own]
    ends = _matched(descriptors[own], points, descriptors, frame, count)
    moves = np.abs(ends - start) > _TOLERANCE_PX
    free = np.ones(len(own), bool)
    groups = []
    for _ in range(_BODIES):
        members = np.zeros(len(own), bool)
        for k in range(count):
            some = np.flatnonzero(free & moves[k])
            agree = _agreeing(start[some], ends[k, some], _TOLERANCE_PX, _TRIALS)
            if agree.sum() > members.sum():
                members[:] = False
                members[some[agree]] = True
        if members.sum() < _FEWEST:
            break
        group, members = _followed(start, ends, moves, members & free)
        free &= ~members
        if group is not None:
            groups.append(group)
    return groups


def _matched(
    own: NDArray[np.float32], points: Complexes, descriptors: NDArray[np.float32], frame: NDArray[np.int64], count: int
) -> Complexes:
    """Return (K, n) places of n features in K frames; NaN where none is distinctly like it."""
    similarity = own @ descriptors.T
    ends = np.full((count, len(own)), np.nan + 0j)
    bounds = np.searchsorted(frame, np.arange(count + 1))
    for k in range(count):
        part = similarity[:, bounds[k] : bounds[k + 1]]
        if part.shape[1] < 2:
            continue
        best = part.argmax(axis=1)
        two = np.partition(part, -2, axis=1)[:, -2:]
        # the squared distance of unit vectors is 2 − 2·similarity
        distinct = 1.0 - two[:, 1] < _DISTINCT**2 * (1.0 - two[:, 0])
        ends[k, distinct] = points[bounds[k] + best[distinct]]
    return ends


def _followed(
    start: Complexes, ends: Complexes, moves: NDArray[np.bool_], members: NDArray[np.bool_]
) -> tuple[Group | None, NDArray[np.bool_]]:
    """Follow a body over the frames, and gather the features that move with it."""
    count = len(ends)
    seed = members
    for _ in range(2):
        turn = np.full(count, np.nan + 0j)
        shift = np.full(count, np.nan + 0j)
        for k in range(count):
            some = np.flatnonzero(members & np.isfinite(ends[k]))
            agree = some[_agreeing(start[some], ends[k, some], _TOLERANCE_PX, _TRIALS)]
            if len(agree) >= 2:
                turn[k], shift[k] = _rigid(start[agree], ends[k, agree])
        follows = np.abs(turn[:, None] * start + shift[:, None] - ends) < _TOLERANCE_PX
        known = np.isfinite(turn)[:, None] & np.isfinite(ends)
        yes, no = (follows & moves).sum(axis=0), (known & ~follows).sum(axis=0)
        members = (yes >= 2) & (yes > no)
        if members.sum() < _FEWEST:
            return None, seed
    body = start[members]
    middle = complex(body.mean())
    support = float((follows & moves)[:, members].sum())
    reach2 = float((np.abs(body - middle) ** 2).mean())
    return Group(turn * middle + shift, turn, middle, reach2, support), members | seed


def _rigid(start: Complexes, end: Complexes) -> tuple[complex, complex]:
    """Return rotation and shift, end = rotation·start + shift, by least squares."""
    a, b = start.mean(), end.mean()
    turn = np.exp(1j * np.angle(((end - b) * np.conj(start - a)).sum()))
    return complex(turn), complex(b - turn * a)


def _agreeing(start: Complexes, end: Complexes, tolerance: float, trials: int) -> NDArray[np.bool_]:
    """Return which matches follow the rigid motion on which most agree."""
    if len(start) < 2:
        return np.zeros(len(start), bool)
    return np.asarray(_consensus(np.ascontiguousarray(start), np.ascontiguousarray(end), tolerance, trials))


@njit("boolean[::1](complex128[::1], complex128[::1], float64, int64)", cache=True, nogil=True)
def _consensus(start, end, tolerance, trials):  # type: ignore[no-untyped-def]
    n = len(start)
    best = np.zeros(n, np.bool_)
    most = 0
    state = 1
    for _ in range(trials):
        state = (state * 1103515245 + 12345) % 2147483648
        i = (state >> 8) % n
        state = (state * 1103515245 + 12345) % 2147483648
        j = (state >> 8) % n
        a, b = start[j] - start[i], end[j] - end[i]
        if abs(a) < 2.0 * tolerance or abs(abs(a) - abs(b)) > tolerance:
            continue
        turn = b * np.conj(a)
        turn /= abs(turn)
        shift = 0.5 * (end[i] + end[j] - turn * (start[i] + start[j]))
        agree = np.abs(turn * start + shift - end) < tolerance
        number = agree.sum()
        if number > most:
            most, best = number, agree
    return best


def _relation(one: Group, other: Group) -> tuple[complex, complex] | None:
    """Return the rigid motion between the coordinates of two groups if they are one body; ``None`` if not.

    The pose of the other is, in each frame, that of the one after this motion.
    """
    both = np.isfinite(one.place) & np.isfinite(other.place)
    if both.sum() < 3:
        return None
    turns = one.direction[both] * np.conj(other.direction[both])
    turn = np.exp(1j * np.angle(np.median(turns.real) + 1j * np.median(turns.imag)))
    # the middle of the one, in the coordinates of the other
    seen = (one.place[both] - other.place[both]) * np.conj(other.direction[both]) + other.middle
    at = complex(np.median(seen.real), np.median(seen.imag))
    reach = np.sqrt(one.reach2)
    near = (np.abs(seen - at) < 2 * _TOLERANCE_PX) & (np.abs(turns - turn) * reach < 2 * _TOLERANCE_PX)
    return (complex(turn), at) if near.sum() >= max(3, 0.5 * both.sum()) else None


def _completed(group: Group, others: list[Group]) -> Group:
    """Return a group that is also known where others that are the same body are seen."""
    place, direction = group.place.copy(), group.direction.copy()
    for other in others:
        relation = _relation(group, other)
        if relation is not None:
            turn, at = relation
            new = ~np.isfinite(place) & np.isfinite(other.place)
            place[new] = other.place[new] + other.direction[new] * (at - other.middle)
            direction[new] = other.direction[new] * turn
    return Group(place, direction, group.middle, group.reach2, group.support)
