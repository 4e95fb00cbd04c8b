"""Find the mouth in a few frames of a clip: the patch of the right hue that travels on a circle.

Nothing is known yet but a hue, so patches are cut out at several levels of it. A mug on the table has the mouth's
colour but stays; a toy that swings by moves but keeps no distance from the pivot; a face moves with the mouth but
is less red. What is left is told by how often it is seen, how constant it is in size, and how it stands out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from anglecam.vision.carried import carried_share
from anglecam.vision.circle import circle_through
from anglecam.vision.colour import ColourModel, chroma_of, hue_contrast, learn_colour

Image = NDArray[Any]
"""Bytes, but cv2's type hints do not know it."""
Floats = NDArray[np.float64]

LEVELS = (0.3, 0.4, 0.5, 0.6, 0.7)
"""Shares of the way from the picture's usual hue to its most mouth-like one at which patches are cut out."""
SMALLEST_PX2 = 12.0
"""A smaller patch has no centroid worth the name."""
_LARGEST_SHARE = 0.04
"""Of the picture; a mouth is smaller."""
_LEAST_CONTRAST = 8.0
"""Units of a*, b* by which the mouth's hue must stand out; JPEG's own chroma errors reach 3 or 4."""
_TOLERANCE_PX = 2.0
"""Coarse patches are placed this well."""
_MOVED_PX = 4.0
"""A path with a smaller extent counts as rest."""
_HINT_PX = 30.0
"""A hint at the pivot may be off by this much."""
_SKIN_A = (4.0, 24.0)
"""a* of skin of every complexion; its b* is one to three times that."""
_TOP_PX = 40
"""The most mouth-like hue is that of the 40th pixel, past the codec's outliers."""
_MOST_NOISE = 0.15
"""Standard deviation of the surroundings' fraction of mouth above which they and the mouth are one."""
_BENT_PX = 0.5
"""Distance from a straight line from which on a way is surely none."""
_STRAIGHT = 0.1
"""What a straight way counts against a bent one: a mouth that hardly moves has no other."""
_TOGETHER = 2
"""Power with which it counts that a patch moves with its surroundings."""
_PER_FRAME = 12
_TRIALS = 600
_HUE_TOLERANCE = np.radians(25.0)


@dataclass(frozen=True)
class Found:
    """The mouth as the search found it."""

    model: ColourModel
    """Its colour, learnt from the clip."""
    area_px2: float
    """Its typical area in pixels, coarse."""
    place_px: Floats
    """(2,) its median place, px."""
    circle: tuple[Floats, float] | None
    """Coarse centre and radius of its path, px; ``None`` where it does not move."""


@dataclass(frozen=True)
class _Patches:
    frame: NDArray[np.int64]
    filmed: Floats
    place: Floats
    area: Floats
    contrast: Floats
    label: NDArray[np.int64]


@dataclass(frozen=True)
class _Track:
    score: float
    level: float
    members: NDArray[np.int64]
    patches: _Patches
    circle: tuple[Floats, float] | None


@dataclass(frozen=True)
class _Way:
    score: float
    """What the patches are worth if they lie on their circle and it is bent."""
    bent: float
    """How surely they do not lie on a straight line, 0 to 1."""


def find_mouth(
    images: Sequence[Image],
    rgb: tuple[int, int, int] | None,
    near_px: Floats | None,
    placed: Callable[[int, Floats], Floats],
) -> Found | None:
    """Find the mouth and learn its colour from frames spread over a clip.

    Parameters
    ----------
    images : sequence of ndarray
        (h, w, 3) frames, blue, green, red.
    rgb : tuple of int, optional
        The declared colour, good to some tens of grey levels; without it the mouth is the reddest thing, as
        against skin, that moves.
    near_px : ndarray, optional
        (2,) a hint at the pivot, in the plane of motion, px; where nothing turns about it, what turns about another.
    placed : callable
        Where a point (2,) of the i-th picture lies in the plane of motion, in which paths are circles, px.

    Returns
    -------
    Found or None
        ``None`` where nothing stands out in hue, or what does stand still while other things move.
    """
    maps = [cv2.GaussianBlur(hue_contrast(image, rgb), (0, 0), 1.0) for image in images]
    at_rest = not _something_moves(images)
    usual, top = _hue_range(maps, at_rest)
    if top - usual < _LEAST_CONTRAST:
        return None
    cuts = []
    for share in LEVELS:
        level = usual + share * (top - usual)
        if level - usual >= _LEAST_CONTRAST / 2.0:
            cuts.append((level, _cut_out(maps, level, usual, placed)))
    # a hint misleads where a slanted view shows the mark on a shaft far from what it turns about
    for hint in (near_px,) if near_px is None else (near_px, None):
        tracks: list[_Track | None] = []
        for level, patches in cuts:
            tracks.append(_moving_track(patches, images, level, hint))
            if at_rest:
                tracks.append(_resting_track(patches, images, level))
        for track in sorted((one for one in tracks if one is not None), key=lambda t: -t.score):
            model = _learn(images, maps, track)
            if model is None or (rgb is not None and not _same_hue(model.chroma, chroma_of(rgb))):
                continue
            area, place = track.patches.area[track.members], track.patches.place[track.members]
            return Found(model, float(np.median(area)), np.median(place, axis=0), track.circle)
    return None


def _hue_range(maps: Sequence[NDArray[Any]], at_rest: bool) -> tuple[float, float]:
    """Return the usual hue contrast of the picture, and the top one: of what changes, if enough does."""
    stack_max = np.maximum.reduce(list(maps))
    change = stack_max - np.minimum.reduce(list(maps))
    usual = float(np.median(maps[0]))
    # What moves sets the scale, for a static thing may be far redder than the mouth.
    moving = stack_max[change > _LEAST_CONTRAST]
    top = moving if moving.size >= _TOP_PX and not at_rest else stack_max.ravel()
    return usual, float(np.partition(top, -_TOP_PX)[-_TOP_PX])


def _cut_out(
    maps: Sequence[NDArray[Any]], level: float, usual: float, placed: Callable[[int, Floats], Floats]
) -> _Patches:
    frame, filmed, place, area, contrast, label = [], [], [], [], [], []
    for t, hue in enumerate(maps):
        _, _, stats, centres = cv2.connectedComponentsWithStats((hue > level).astype(np.uint8), connectivity=8)
        sizes = stats[:, cv2.CC_STAT_AREA]
        largest = _LARGEST_SHARE * hue.size
        fit = [k for k in np.argsort(-sizes) if k and SMALLEST_PX2 <= sizes[k] <= largest][:_PER_FRAME]
        for k in fit:
            x, y, w, h = stats[k, :4]
            part = hue[y : y + h, x : x + w]
            frame.append(t)
            filmed.append(centres[k])
            place.append(placed(t, centres[k]))
            area.append(sizes[k])
            contrast.append(np.percentile(part[part > level], 75) - usual)
            label.append(k)
    return _Patches(
        np.array(frame, np.int64),
        np.array(filmed, float).reshape(-1, 2),
        np.array(place, float).reshape(-1, 2),
        np.array(area, float),
        np.array(contrast, float),
        np.array(label, np.int64),
    )


def _moving_track(patches: _Patches, images: Sequence[Image], level: float, hint: Floats | None) -> _Track | None:
    """Find the circle on which one patch of constant size and colour travels, by random triples of poses."""
    frames = len(images)
    poses = _poses(patches)
    if len(poses) < 2 or frames < 2:
        return None
    longest = 1.5 * float(np.hypot(*images[0].shape[:2]))
    rng = np.random.default_rng(0)
    best: _Track | None = None
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


def _ends(track: _Track) -> tuple[int, int]:
    """Name the first of a track's patches, and the one farthest from it."""
    place = track.patches.place[track.members]
    return int(track.members[0]), int(track.members[np.argmax(np.hypot(*(place - place[0]).T))])


def _carried(track: _Track, ends: tuple[int, int], images: Sequence[Image]) -> float:
    """Tell how surely a patch is a part of what moves around it."""
    patches, rows = track.patches, list(ends)
    centre = patches.place[track.members].mean(axis=0) if track.circle is None else track.circle[0]
    (here, there), arm = patches.filmed[rows], patches.place[rows] - centre
    shaken = (there - patches.place[ends[1]]) - (here - patches.place[ends[0]])
    turn = float(np.arctan2(arm[0, 1], arm[0, 0]) - np.arctan2(arm[1, 1], arm[1, 0]))
    first, second = (images[patches.frame[end]] for end in ends)
    area = float(np.median(patches.area[track.members]))
    return carried_share(first, second, here, there, here + shaken, turn, area)


def _poses(patches: _Patches) -> NDArray[np.int64]:
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
    patches: _Patches,
    frames: int,
    level: float,
    centre: Floats,
    radius: float,
    size: float,
    tint: float,
    least: float,
    ways: dict[bytes, _Way | None],
) -> _Track | None:
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
    return _Track(score, level, members, patches, (centre, radius))


def _way(patches: _Patches, members: NDArray[np.int64], frames: int) -> _Way | None:
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


def _score(patches: _Patches, members: NDArray[np.int64], frames: int, extent: float) -> float:
    """Seen in every frame, standing out in hue, constant in size, not tiny, and travelling."""
    size = patches.area[members]
    steady = np.exp(-4.0 * float(np.std(np.log(size))))
    seen = len(set(patches.frame[members])) / frames
    travel = 1.0 - np.exp(-extent / 10.0)
    return float(seen**2 * np.median(patches.contrast[members]) * steady * np.median(size) ** 0.25 * (0.1 + travel))


def _resting_track(patches: _Patches, images: Sequence[Image], level: float) -> _Track | None:
    """Take the patch that stands out most in a clip in which nothing moves."""
    if not len(patches.frame):
        return None
    best: _Track | None = None
    for seed in np.flatnonzero(patches.frame == patches.frame[0]):
        near = np.hypot(*(patches.place - patches.place[seed]).T) < _MOVED_PX
        alike = np.abs(np.log(patches.area / patches.area[seed])) < 0.4
        members = np.flatnonzero(near & alike)
        score = _score(patches, members, len(images), 0.0) * (0.2 + _skin_around(images[0], patches, int(seed)))
        if best is None or score > best.score:
            best = _Track(score, level, members, patches, None)
    return best


def _skin_around(image: Image, patches: _Patches, seed: int) -> float:
    """Return the share of the pixels around a patch that have a skin's hue; lips at rest have nothing else to show."""
    reach = round(float(np.sqrt(patches.area[seed])))
    x, y = np.round(patches.place[seed]).astype(int)
    box = image[max(y - reach, 0) : y + reach + 1, max(x - reach, 0) : x + reach + 1]
    a, b = (cv2.cvtColor(box, cv2.COLOR_BGR2LAB)[..., k].astype(float) - 128.0 for k in (1, 2))
    return float(((a > _SKIN_A[0]) & (a < _SKIN_A[1]) & (b > a) & (b < 3.0 * a)).mean())


def _something_moves(images: Sequence[Image]) -> bool:
    """Tell whether more than a mouth's worth of pixels changes, flicker of the light left out."""
    small = [cv2.GaussianBlur(cv2.cvtColor(i, cv2.COLOR_BGR2GRAY), (0, 0), 2.0)[::2, ::2].astype(float) for i in images]
    median = np.median(small, axis=0)
    for picture in small:
        gain = np.median((picture + 1.0) / (median + 1.0))
        if (np.abs(picture - gain * median) > 12.0).mean() > 1e-3:
            return True
    return False


def _learn(images: Sequence[Image], maps: Sequence[NDArray[Any]], track: _Track) -> ColourModel | None:
    """Learn the colour from a track's patches; ``None`` where they do not stand out from what is next to them."""
    inside, around, elsewhere, contrast = [], [], [], []
    for m in track.members:
        t = int(track.patches.frame[m])
        red = (maps[t] > track.level).astype(np.uint8)
        _, labels = cv2.connectedComponents(red, connectivity=8)
        own = (labels == track.patches.label[m]).astype(np.uint8)
        core = cv2.erode(own, np.ones((3, 3), np.uint8))
        core = core if core.sum() >= 6 else own
        # Edge pixels are neither; then a collar as wide as the mouth, without other patches of the colour.
        grown = cv2.dilate(own, np.ones((9, 9), np.uint8))
        wide = 2 * max(8, round(float(np.sqrt(own.sum())) / 2.0)) + 1
        collar: Image = cv2.dilate(grown, np.ones((wide, wide), np.uint8)) - grown
        red_too: Image = cv2.dilate(red, np.ones((9, 9), np.uint8))
        collar = collar & (1 - red_too)
        inside.append(images[t][core > 0])
        around.append(images[t][collar > 0])
        if collar.any():
            contrast.append(float(np.median(maps[t][core > 0]) - np.median(maps[t][collar > 0])))
        rest = np.s_[::8, ::8]
        elsewhere.append(images[t][rest][red_too[rest] == 0])
    parts = [np.concatenate(p).astype(float) for p in (inside, around, elsewhere)]
    # A blush stands out from the wall, but not from the face.
    if min(map(len, parts)) < 20 or np.median(contrast) < _LEAST_CONTRAST:
        return None
    model = learn_colour(*parts)
    return model if model.noise < _MOST_NOISE else None


def _same_hue(chroma: Floats, declared: Floats) -> bool:
    """Tell whether a colour is the declared one but for shading, which moves a*, b* along the hue."""
    here, there = np.hypot(*chroma), np.hypot(*declared)
    angle = np.arctan2(chroma[1], chroma[0]) - np.arctan2(declared[1], declared[0])
    return bool(abs((angle + np.pi) % (2.0 * np.pi) - np.pi) < _HUE_TOLERANCE and 0.4 * there < here < 1.8 * there)
