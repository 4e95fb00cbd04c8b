"""Which of many patches is one thing that travels on a circle, or rests where nothing moves.

It is told by how often it is seen, how constant it is in size, how it stands out, and whether what is around it moves
along.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats, Image
from anglecam.vision.mark.blobs import Blobs
from anglecam.vision.mark.co_motion import co_motion_share
from anglecam.vision.pivot.circle import circle_through

_TOLERANCE_PX = 2.0
"""Coarse patches are placed this well."""
_MOVED_PX = 4.0
"""A path with a smaller extent counts as rest."""
_HINT_PX = 30.0
"""A hint at the pivot may be off by this much."""
_SKIN_A = (4.0, 24.0)
"""a* of skin of every complexion; its b* is one to three times that."""
_BENT_PX = 0.5
"""Distance from a straight line from which on a way is surely none."""
_STRAIGHT = 0.1
"""What a straight way counts against a bent one: a mouth that hardly moves has no other."""
_TOGETHER = 2
"""Power with which it counts that a patch moves with its surroundings."""
_TRIALS = 600


@dataclass(frozen=True)
class BlobTrack:
    """What is taken for one thing in many pictures."""

    score: float
    """The more, the more mouth-like."""
    level: float
    """Hue contrast at which the patches were cut out."""
    members: NDArray[np.int64]
    """Numbers of its patches."""
    patches: Blobs
    """All patches."""
    circle: tuple[Floats, float] | None
    """Centre and radius of its path, px; ``None`` at rest."""


@dataclass(frozen=True)
class _Way:
    score: float
    """What the patches are worth if they lie on their circle and it is bent."""
    bent: float
    """How surely they do not lie on a straight line, 0 to 1."""


def moving_track(patches: Blobs, images: Sequence[Image], level: float, hint: Floats | None) -> BlobTrack | None:
    """Find the circle on which one patch of constant size and colour travels, by random triples of poses."""
    frames = len(images)
    poses = _poses(patches)
    if len(poses) < 2 or frames < 2:
        return None
    longest = 1.5 * float(np.hypot(*images[0].shape[:2]))
    rng = np.random.default_rng(0)
    best: BlobTrack | None = None
    seen: set[tuple[int, ...]] = set()
    carried: dict[tuple[int, int], float] = {}
    ways: dict[bytes, _Way | None] = {}
    for trial in range(_TRIALS):
        # In a clip that hardly moves there are but two poses to be had.
        some = rng.choice(poses, size=min(2 + (trial % 4 > 0), len(poses)), replace=False)
        key = tuple(sorted(some))
        if key in seen or len(set(patches.frame[some])) < len(some):
            continue
        seen.add(key)
        size, tint = patches.area[some], patches.contrast[some]
        if size.max() > 1.6 * size.min() or tint.max() > 1.5 * tint.min():
            continue
        circle = _circle_of(patches.place[some], hint, longest)
        if circle is None:
            continue
        least = 0.0 if best is None else best.score
        track = _follow(patches, frames, level, *circle, float(np.median(size)), float(np.median(tint)), least, ways)
        if track is None or (best is not None and track.score <= best.score):
            continue
        ends = _ends(track)
        if ends not in carried:
            carried[ends] = _carried(track, ends, images)
        track = replace(track, score=track.score * carried[ends] ** _TOGETHER)
        if best is None or track.score > best.score:
            best = track
    return best


def _ends(track: BlobTrack) -> tuple[int, int]:
    """Name the first of a track's patches, and the one farthest from it."""
    place = track.patches.place[track.members]
    return int(track.members[0]), int(track.members[np.argmax(np.hypot(*(place - place[0]).T))])


def _carried(track: BlobTrack, ends: tuple[int, int], images: Sequence[Image]) -> float:
    """Tell how surely a patch is a part of what moves around it."""
    patches, rows = track.patches, list(ends)
    centre = patches.place[track.members].mean(axis=0) if track.circle is None else track.circle[0]
    (here, there), arm = patches.filmed[rows], patches.place[rows] - centre
    shaken = (there - patches.place[ends[1]]) - (here - patches.place[ends[0]])
    turn = float(np.arctan2(arm[0, 1], arm[0, 0]) - np.arctan2(arm[1, 1], arm[1, 0]))
    first, second = (images[patches.frame[end]] for end in ends)
    area = float(np.median(patches.area[track.members]))
    return co_motion_share(first, second, here, there, here + shaken, turn, area)


def _poses(patches: Blobs) -> NDArray[np.int64]:
    """Pick one patch of each place and size, so that a long rest does not drown a short motion."""
    key = np.column_stack([np.round(patches.place / _MOVED_PX), np.round(np.log(patches.area) / 0.3)])
    _, first = np.unique(key, axis=0, return_index=True)
    return first


def _circle_of(p: Floats, hint: Floats | None, longest: float) -> tuple[Floats, float] | None:
    """Lay a circle through two or three places; where they leave the radius open, about the hint."""
    chord = p[:, None, :] - p[None, :, :]
    if np.hypot(chord[..., 0], chord[..., 1])[~np.eye(len(p), dtype=bool)].min() < _MOVED_PX / 2.0:
        return None
    if len(p) == 3:
        centre, radius = circle_through(p)
        if hint is None or np.hypot(*(centre - hint)) <= _HINT_PX:
            return (centre, radius) if 20.0 < radius < longest else None
    if hint is not None:
        distance = np.hypot(*(p - hint).T)
        # A hint that is off by e changes the distance by up to e times the angle between the places.
        open_px = _TOLERANCE_PX + _HINT_PX * float(np.hypot(*np.ptp(p, axis=0))) / max(float(distance.min()), 1.0)
        return (hint, float(np.median(distance))) if np.ptp(distance) < open_px else None
    if len(p) == 3:
        return None
    # Two places and no hint: on so short a way any circle will do to look along.
    way = p[1] - p[0]
    return p.mean(axis=0) + 5.0 * np.array([-way[1], way[0]]), 5.0 * float(np.hypot(*way))


def _follow(
    patches: Blobs,
    frames: int,
    level: float,
    centre: Floats,
    radius: float,
    size: float,
    tint: float,
    least: float,
    ways: dict[bytes, _Way | None],
) -> BlobTrack | None:
    """Take from each frame the patch that lies on the circle and is most like the trio; score what comes out.

    ``None`` where it cannot be more than the least score that is asked for. What was found of each choice of patches
    is kept in ``ways``.
    """
    off = np.abs(np.hypot(*(patches.place - centre).T) - radius)
    unlike = np.abs(np.log(patches.area / size)) + np.abs(np.log(np.maximum(patches.contrast, 1e-3) / tint))
    fit = np.flatnonzero((off < _TOLERANCE_PX) & (unlike < 0.6))
    if len(fit) < 3:
        return None
    # the most alike of each frame: sort by likeness, keep the first of each frame
    fit = fit[np.argsort(unlike[fit] + off[fit] / _TOLERANCE_PX)]
    _, first = np.unique(patches.frame[fit], return_index=True)
    members = fit[first]
    key = members.tobytes()
    if key not in ways:  # many circles pick the same patches
        ways[key] = _way(patches, members, frames)
    way = ways[key]
    if way is None or way.score < least:  # what follows makes it no larger
        return None
    off_px = off[members]
    score = way.score * np.exp(-np.mean((off_px / _TOLERANCE_PX) ** 2)) * (_STRAIGHT + (1.0 - _STRAIGHT) * way.bent)
    return BlobTrack(score, level, members, patches, (centre, radius))


def _way(patches: Blobs, members: NDArray[np.int64], frames: int) -> _Way | None:
    """Tell what the patches of a track have to do with each other, whatever circle they lie on; ``None`` if nothing."""
    place = patches.place[members]
    extent = float(np.hypot(*np.ptp(place, axis=0)))
    if extent < _MOVED_PX or len(members) < 3:
        return None
    # what goes to and fro on a straight line turns about nothing that could be seen
    bent = 1.0 - np.exp(-((_off_a_line(place) / _BENT_PX) ** 2))
    return _Way(_score(patches, members, frames, extent), float(bent))


def _off_a_line(place: Floats) -> float:
    """Root mean square distance of places from the straight line that fits them best, px."""
    return float(np.sqrt(max(np.linalg.eigvalsh(np.cov(place.T))[0], 0.0)))


def _score(patches: Blobs, members: NDArray[np.int64], frames: int, extent: float) -> float:
    """Seen in every frame, standing out in hue, constant in size, not tiny, and travelling."""
    size = patches.area[members]
    steady = np.exp(-4.0 * float(np.std(np.log(size))))
    seen = len(set(patches.frame[members])) / frames
    travel = 1.0 - np.exp(-extent / 10.0)
    return float(seen**2 * np.median(patches.contrast[members]) * steady * np.median(size) ** 0.25 * (0.1 + travel))


def resting_track(patches: Blobs, images: Sequence[Image], level: float) -> BlobTrack | None:
    """Take the patch that stands out most in a clip in which nothing moves."""
    if not len(patches.frame):
        return None
    best: BlobTrack | None = None
    for seed in np.flatnonzero(patches.frame == patches.frame[0]):
        near = np.hypot(*(patches.place - patches.place[seed]).T) < _MOVED_PX
        alike = np.abs(np.log(patches.area / patches.area[seed])) < 0.4
        members = np.flatnonzero(near & alike)
        score = _score(patches, members, len(images), 0.0) * (0.2 + _skin_around(images[0], patches, int(seed)))
        if best is None or score > best.score:
            best = BlobTrack(score, level, members, patches, None)
    return best


def _skin_around(image: Image, patches: Blobs, seed: int) -> float:
    """Return the share of the pixels around a patch that have a skin's hue; lips at rest have nothing else to show."""
    reach = round(float(np.sqrt(patches.area[seed])))
    x, y = np.round(patches.place[seed]).astype(int)
    box = image[max(y - reach, 0) : y + reach + 1, max(x - reach, 0) : x + reach + 1]
    a, b = (cv2.cvtColor(box, cv2.COLOR_BGR2LAB)[..., k].astype(float) - 128.0 for k in (1, 2))
    return float(((a > _SKIN_A[0]) & (a < _SKIN_A[1]) & (b > a) & (b < 3.0 * a)).mean())
