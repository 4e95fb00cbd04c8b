"""Proposals from patches that stand out and travel about a centre.

In each frame, patches differ from the median of all frames, or from their surroundings. Two or three
patches of different frames that are alike may be one object: three places lie on a circle; of an elongated patch, two
places and directions show a centre. Circles and centres are drawn at random, and all frames vote (RANSAC, Fischler and
Bolles, CACM 24, 1981): each by the patch that is most like the drawn ones and nearest to where it should be.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from anglecam.data.typing import Floats
from anglecam.engine.proposals.common_centre import fit_centre, proposal_of, same_path, turn_about, up
from anglecam.engine.sample import Sample
from anglecam.engine.score import Proposal

_NOISE = 6.0
"""Standard deviations of a pixel: the lowest level of a patch. Of 10⁵ pixels none differs as much by chance."""
_SURROUNDINGS_PX = (3.0, 10.0)
"""Standard deviations of the blur that makes the surroundings of a patch."""
_LEAST_AREA_PX2 = 6
_LARGEST_SHARE = 0.2
"""Of the picture: the area of the largest patch."""
_PATCHES = 8
"""Of a picture, at one level and of one sign, at most."""
_SCENERY = 0.75
"""Share of the frames in which scenery is where it is."""
_ELONGATED = 2.5
"""Ratio of the axes from which on the direction of a patch is known."""
_TOLERANCE_PX = 2.0
_ALIKE = 0.5
"""Difference of the logarithms of size and contrast up to which two patches may be one object."""
_STRAIGHT = 30.0
"""Radius of a circle, in sides of the picture, that passes for a straight line: over the whole side it is off by 1/240
of it, and over what usually moves by less than a pixel. What slides has to be proposed, too, as a rival."""
_DRAWS = 1500
"""Of one level and sign."""
_MOST = 12


@dataclass
class Patches:
    """The patches of one level and sign in all frames; arrays of length n."""

    frame: NDArray[np.int64]
    place: NDArray[np.complex128]
    """px, imaginary axis upwards."""
    spin: NDArray[np.complex128]
    """Direction of the longer axis, of length 1, squared; 0 where it is not known."""
    likeness: Floats
    """(n, 3) logarithms of area, contrast and extent."""
    spread2: Floats
    """Mean square distance of a patch's pixels from its place, px²."""


def proposals(sample: Sample) -> list[Proposal]:
    """Return at most twelve proposals, those for which most frames vote first."""
    count = len(sample.pictures)
    longest = _STRAIGHT * max(sample.pictures.shape[1:])
    tracks = []
    for patches in _all_patches(sample):
        if len(np.unique(patches.frame)) < max(3, count // 4):
            continue
        for rigid in (False, True):
            for votes, some, centre, arm in _tracks(patches, count, longest, rigid):
                tracks.append((votes, patches, some, centre, arm, rigid))
    tracks.sort(key=lambda one: -one[0])
    found: list[Proposal] = []
    paths: list[NDArray[np.complex128]] = []
    for _, patches, some, centre, arm, rigid in tracks:
        place = np.full(count, np.nan + 0j)
        spin = np.zeros(count, complex)
        place[patches.frame[some]] = patches.place[some]
        if rigid:
            near = np.angle((patches.place[some] - centre) / arm)
            half = np.angle(patches.spin[some] / patches.spin[some[0]]) / 2
            half += np.pi * np.round((near - half) / np.pi)
            spin[patches.frame[some]] = np.exp(1j * half) * patches.spread2[some]
        centre, arm = fit_centre(place, spin, centre, arm)
        turn = turn_about(centre, arm, place, spin)
        path = centre + arm * np.exp(1j * turn)
        if any(same_path(path, other, _TOLERANCE_PX) for other in paths):
            continue
        paths.append(path)
        found.append(
            proposal_of(sample, "rod" if rigid else "blob", centre, np.where(np.isfinite(place), turn, np.nan))
        )
        if len(found) == _MOST:
            break
    return found


def _all_patches(sample: Sample) -> list[Patches]:
    """Return the patches of each map and level."""
    median = np.median(sample.pictures, axis=0)
    change = sample.pictures - median
    maps = [change, -change, np.abs(change)]
    for width in _SURROUNDINGS_PX:
        contrast = np.stack([p - cv2.GaussianBlur(p, (0, 0), width) for p in sample.pictures])
        maps += [contrast, -contrast]
    found = []
    low = _NOISE * sample.noise
    for signed in maps:
        high = 0.5 * float(np.quantile(signed, 0.999))
        levels = np.geomspace(low, high, 3) if high > low else np.array([low])
        found += [_patches(signed, float(level)) for level in levels]
    return found


def _patches(signed: NDArray[np.float32], level: float) -> Patches:
    """Return the patches of a map's frames above a level, without those that rest."""
    count = len(signed)
    largest = _LARGEST_SHARE * signed[0].size
    labelled, boxes, places, keys = [], [], [], []
    for k, picture in enumerate(signed):
        _, labels, stats, centroids = cv2.connectedComponentsWithStats((picture > level).astype(np.uint8))
        area = stats[1:, cv2.CC_STAT_AREA]
        fits = np.flatnonzero((area >= _LEAST_AREA_PX2) & (area <= largest)) + 1
        labelled.append(labels)
        boxes.append(stats[fits])
        places.append(centroids[fits])
        keys.append(np.column_stack([np.full(len(fits), k), fits]))
    box, place, key = np.concatenate(boxes), np.concatenate(places), np.concatenate(keys)
    area = box[:, cv2.CC_STAT_AREA]
    rests = _often(key[:, 0], place, np.log(area), count) > _SCENERY * count
    order = np.lexsort((-area, key[:, 0]))
    order = order[~rests[order]]
    frame = key[order, 0]
    order = order[np.arange(len(order)) - np.searchsorted(frame, frame) < _PATCHES]
    rows = np.empty((len(order), 4), complex)
    for row, i in zip(rows, order, strict=True):
        left, top, width, height, _ = box[i]
        part = np.s_[top : top + height, left : left + width]
        row[:] = _moments(labelled[key[i, 0]][part], key[i, 1], signed[key[i, 0]][part])
    second, spread2, size, contrast = rows[:, 0], rows[:, 1].real, rows[:, 2].real, rows[:, 3].real
    # spread² and |second| are sum and difference of the squared axes
    axes = np.sqrt((spread2 + np.abs(second)) / np.maximum(spread2 - np.abs(second), 0.1))
    spin = np.where(axes > _ELONGATED, second / np.maximum(np.abs(second), 1e-9), 0.0)
    likeness = np.column_stack([0.5 * np.log(size), np.log(contrast), 0.5 * np.log(spread2)])
    return Patches(key[order, 0], up(place[order]), spin, likeness, spread2)


@njit("complex128[::1](int32[:, :], int64, float32[:, :])", cache=True, nogil=True)
def _moments(labels, label, values):  # type: ignore[no-untyped-def]
    """Return four figures of the pixels of a label: (4,) complex.

    The means of the squared offset from their middle, imaginary axis upwards, and of its squared magnitude, their
    number, and the mean of their values.
    """
    count = x = y = xx = yy = xy = level = 0.0
    for i in range(labels.shape[0]):
        for j in range(labels.shape[1]):
            if labels[i, j] == label:
                count, level = count + 1.0, level + values[i, j]
                x, y, xx, yy, xy = x + j, y + i, xx + j * j, yy + i * i, xy + i * j
    x, y = x / count, y / count
    xx, yy, xy = xx / count - x * x, yy / count - y * y, xy / count - x * y
    return np.array([xx - yy - 2.0j * xy, xx + yy + 0.0j, count + 0.0j, level / count + 0.0j])


@njit("float64[::1](int64[:], float64[:, ::1], float64[::1], int64)", cache=True, nogil=True)
def _often(frame, place, size, count):  # type: ignore[no-untyped-def]
    """Return in how many frames a patch of like size is in the place of each."""
    often = np.zeros(len(frame))
    for i in range(len(frame)):
        last = -1
        for j in range(len(frame)):
            near = abs(place[i, 0] - place[j, 0]) < 1.0 and abs(place[i, 1] - place[j, 1]) < 1.0
            if near and frame[j] != last and abs(size[i] - size[j]) < _ALIKE:
                often[i] += 1.0
                last = frame[j]
    return often


def _tracks(
    patches: Patches, count: int, longest: float, rigid: bool
) -> list[tuple[float, NDArray[np.int64], complex, complex]]:
    """Return votes, members, centre and arm of the best tracks of one level and sign."""
    usable = np.flatnonzero(np.abs(patches.spin) > 0.0) if rigid else np.arange(len(patches.frame))
    if len(usable) < 3:
        return []
    frame, place, spin, likeness = (
        np.ascontiguousarray(a[usable]) for a in (patches.frame, patches.place, patches.spin, patches.likeness)
    )
    votes, centres, arms, members = _voted(frame, place, spin, likeness, count, longest, rigid)
    tracks: list[tuple[float, NDArray[np.int64], complex, complex]] = []
    free = np.ones(len(usable), bool)
    for k in np.argsort(-votes):
        some = members[k][members[k] >= 0]
        if votes[k] <= 0.0 or len(tracks) == 4:
            break
        if free[some].mean() < 0.5:
            continue
        free[some] = False
        tracks.append((float(votes[k]), usable[some], complex(centres[k]), complex(arms[k])))
    return tracks


@njit(inline="always")
def _unlike(likeness, i, k):  # type: ignore[no-untyped-def]
    return max(
        abs(likeness[i, 0] - likeness[k, 0]), abs(likeness[i, 1] - likeness[k, 1]), abs(likeness[i, 2] - likeness[k, 2])
    )


@njit(inline="always")
def _alike(likeness, i, k):  # type: ignore[no-untyped-def]
    return _unlike(likeness, i, k) < _ALIKE


@njit(
    "Tuple((float64[::1], complex128[::1], complex128[::1], int64[:, ::1]))(int64[::1], complex128[::1], "
    "complex128[::1], float64[:, ::1], int64, float64, boolean)",
    cache=True,
    nogil=True,
)
def _voted(frame, place, spin, likeness, count, longest, rigid):  # type: ignore[no-untyped-def]
    """Draw circles or centres, and let all frames vote for each."""
    n = len(frame)
    votes, members = np.zeros(_DRAWS), np.full((_DRAWS, count), -1)
    centres, arms = np.zeros(_DRAWS, np.complex128), np.zeros(_DRAWS, np.complex128)
    np.random.seed(0)  # noqa: NPY002 - of Numba
    best = np.empty(count)
    for d in range(_DRAWS):
        i = np.random.randint(n)  # noqa: NPY002
        j = third = -1
        for _ in range(30):
            k = np.random.randint(n)  # noqa: NPY002
            if frame[k] == frame[i] or not _alike(likeness, i, k) or abs(place[k] - place[i]) < 2.0 * _TOLERANCE_PX:
                continue
            if j < 0:
                j = k
            elif frame[k] != frame[j] and abs(place[k] - place[j]) >= 2.0 * _TOLERANCE_PX:
                third = k
            if j >= 0 and (rigid or third >= 0):
                break
        if j < 0 or (not rigid and third < 0):
            continue
        if rigid:
            turn = np.sqrt(spin[j] / spin[i])
            if np.random.random() < 0.5:  # noqa: NPY002
                turn = -turn
            if abs(turn - 1.0) < 0.05:
                continue
            centre = (place[j] - turn * place[i]) / (1.0 - turn)
        else:
            a, b = place[j] - place[i], place[third] - place[i]
            area = (np.conj(a) * b).imag
            if abs(area) < 1e-6 * abs(a) * abs(b):
                continue
            centre = place[i] + 1j * (abs(a) ** 2 * b - abs(b) ** 2 * a) / (-2.0 * area)
        arm = place[i] - centre
        radius = abs(arm)
        if radius > longest or (not rigid and radius < 4.0 * _TOLERANCE_PX):
            continue
        best[:] = 0.0
        for k in range(n):
            off = abs(abs(place[k] - centre) - radius)
            if off > _TOLERANCE_PX or not _alike(likeness, i, k):
                continue
            if rigid:
                half = np.sqrt(spin[k] / spin[i])
                off = min(abs(place[k] - centre - half * arm), abs(place[k] - centre + half * arm))
                if off > _TOLERANCE_PX:
                    continue
            # how alike they are tells objects apart better than how near they lie
            good = 1.0 - 0.3 * off / _TOLERANCE_PX - 0.7 * _unlike(likeness, i, k) / _ALIKE
            t = frame[k]
            if good > best[t]:
                best[t], members[d, t] = good, k
        votes[d], centres[d], arms[d] = best.sum(), centre, arm
    return votes, centres, arms, members
