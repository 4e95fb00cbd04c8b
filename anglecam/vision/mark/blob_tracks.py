"""Track of one blob through sampled frames: on a circle, or at rest in a clip where nothing moves.

A track is scored by the share of frames in which the blob is seen, by how constant its size is, by its contrast,
and by whether its surroundings move with it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from statistics import median  # of few values it is faster than NumPy's

import cv2
import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats, Image
from anglecam.vision.mark.blob_circles import MOVED_PX, TOLERANCE_PX, circle_of, draw_blobs
from anglecam.vision.mark.blobs import Blobs
from anglecam.vision.mark.co_motion import co_motion_share

_UNLIKE = 0.6
"""Largest difference of a blob from the drawn ones: the logarithms of the ratios of areas and of contrasts, added."""
_LEAST_CONTRAST = 1e-3
_FEWEST = 3
"""A track has at least as many blobs."""
_SKIN_A = (4.0, 24.0)
"""Range of a* of skin of every complexion; its b* is one to three times its a*."""
_BENT_PX = 0.5
"""RMS distance from the best straight line, px, that makes a path distinctly curved."""
_STRAIGHT_WEIGHT = 0.1
"""Score of a straight path relative to a curved one. It is not zero, because a mark that hardly moves has no curved
path."""
_CO_MOTION_POWER = 2
"""Exponent of the co-motion share in the score."""


@dataclass(frozen=True)
class BlobTrack:
    """Blobs of many pictures that are taken for one object."""

    score: float
    """Larger is more like a mark."""
    level: float
    """Contrast at which the blobs were thresholded."""
    members: NDArray[np.int64]
    """Indices of its blobs."""
    blobs: Blobs
    """All blobs."""
    circle: tuple[Floats, float] | None
    """Centre and radius of its path, px; ``None`` at rest."""


@dataclass(frozen=True)
class _PathScore:
    """The part of a track's score that does not depend on its circle."""

    score: float
    """Score of a curved path on which all blobs lie exactly."""
    bent: float
    """How distinctly the path is curved, 0 to 1."""


@dataclass(frozen=True)
class _Close:
    """The blobs that lie on one circle and are like those through which it was drawn; arrays of length n."""

    index: NDArray[np.int64]
    off_px: Floats
    """Distance from the circle."""
    unlike: Floats
    """Difference from the drawn blobs in size and contrast."""


def moving_track(
    blobs: Blobs,
    images: Sequence[Image],
    level: float,
    hint: Floats | None,
    *,
    on_body: bool,
    through: NDArray[np.intp] | None = None,
) -> BlobTrack | None:
    """Find the circle on which one blob of constant size and colour travels, by random sampling of two or three poses.

    Parameters
    ----------
    blobs : Blobs
        The blobs of all images.
    images : sequence of ndarray
        (h, w, 3) the frames.
    level : float
        Contrast at which the blobs were thresholded.
    hint : ndarray, optional
        (2,) approximate centre of the circle in the plane of motion, px.
    on_body : bool
        Prefer a blob whose surroundings move with it, as those of lips in a face do.
    through : ndarray, optional
        Indices of blobs of which the track must contain one.

    Returns
    -------
    BlobTrack or None
        The track with the highest score.
    """
    frames = len(images)
    if frames < 2:
        return None
    longest = 1.5 * float(np.hypot(*images[0].shape[:2]))
    best: BlobTrack | None = None
    co_motion: dict[tuple[int, int], float] = {}
    path_scores: dict[bytes, _PathScore | None] = {}
    for circle, close in _blobs_on_circles(blobs, draw_blobs(blobs, through), hint, longest):
        least = 0.0 if best is None else best.score
        track = _collect(blobs, frames, level, circle, close, least, path_scores)
        if track is None or (best is not None and track.score <= best.score):
            continue
        if through is not None and not np.isin(track.members, through).any():
            continue
        if on_body:
            ends = _ends(track)
            if ends not in co_motion:
                co_motion[ends] = _co_motion(track, ends, images)
            track = replace(track, score=track.score * co_motion[ends] ** _CO_MOTION_POWER)
        if best is None or track.score > best.score:
            best = track
    return best


def _ends(track: BlobTrack) -> tuple[int, int]:
    """Return the index of a track's first blob and that of the blob farthest from it."""
    place = track.blobs.plane_px[track.members]
    return int(track.members[0]), int(track.members[np.argmax(np.hypot(*(place - place[0]).T))])


def _co_motion(track: BlobTrack, ends: tuple[int, int], images: Sequence[Image]) -> float:
    """Return the co-motion share of a track's blob and its surroundings between two of its poses."""
    blobs, rows = track.blobs, list(ends)
    centre = blobs.plane_px[track.members].mean(axis=0) if track.circle is None else track.circle[0]
    (here, there), arm = blobs.picture_px[rows], blobs.plane_px[rows] - centre
    camera_shift = (there - blobs.plane_px[ends[1]]) - (here - blobs.plane_px[ends[0]])
    turn = float(np.arctan2(arm[0, 1], arm[0, 0]) - np.arctan2(arm[1, 1], arm[1, 0]))
    first, second = (images[blobs.frame[end]] for end in ends)
    area = float(np.median(blobs.area[track.members]))
    return co_motion_share(first, second, here, there, here + camera_shift, turn, area)


def _blobs_on_circles(
    blobs: Blobs, draws: Sequence[NDArray[np.int64]], hint: Floats | None, longest_px: float
) -> Iterator[tuple[tuple[Floats, float], _Close]]:
    """Yield the circles through drawn blobs, and the blobs on each that are like the drawn ones."""
    found = [(circle_of(blobs.plane_px[draw], hint, longest_px), draw) for draw in draws]
    circles = [circle for circle, _ in found if circle is not None]
    if not circles:
        return
    some = [draw for circle, draw in found if circle is not None]
    sizes = np.array([median(blobs.area[draw]) for draw in some])[:, None]
    contrasts = np.array([median(blobs.contrast[draw]) for draw in some])[:, None]
    centres, radii = np.array([centre for centre, _ in circles]), np.array([radius for _, radius in circles])
    away = blobs.plane_px[None, :, :] - centres[:, None, :]
    off = np.abs(np.hypot(away[..., 0], away[..., 1]) - radii[:, None])
    unlike = np.abs(np.log(blobs.area / sizes))
    unlike += np.abs(np.log(np.maximum(blobs.contrast, _LEAST_CONTRAST) / contrasts))
    near = (off < TOLERANCE_PX) & (unlike < _UNLIKE)
    for k in np.flatnonzero(near.sum(axis=1) >= _FEWEST).tolist():
        close = np.flatnonzero(near[k])
        yield circles[k], _Close(close, off[k, close], unlike[k, close])


def _collect(
    blobs: Blobs,
    frames: int,
    level: float,
    circle: tuple[Floats, float],
    close: _Close,
    least: float,
    path_scores: dict[bytes, _PathScore | None],
) -> BlobTrack | None:
    """Take from each frame the blob on the circle that is most like the typical one; score the track.

    Parameters
    ----------
    close : _Close
        The blobs on the circle.
    least : float
        Score that the track must exceed.
    path_scores : dict
        Cache of `_path_score` for each choice of blobs; many circles lead to the same choice.

    Returns
    -------
    BlobTrack or None
        ``None`` where the score cannot exceed the least one.
    """
    # The most similar blob of each frame: from the least similar to the most, the last of each frame remains.
    order = np.argsort(close.unlike + close.off_px / TOLERANCE_PX)[::-1]
    which = np.full(frames, -1)
    which[blobs.frame[close.index[order]]] = order
    taken = which[which >= 0]
    members = close.index[taken]
    key = members.tobytes()
    if key not in path_scores:
        path_scores[key] = _path_score(blobs, members, frames)
    path = path_scores[key]
    if path is None or path.score < least:  # the factors below are at most 1
        return None
    off_px = close.off_px[taken]
    score = (
        path.score
        * np.exp(-np.mean((off_px / TOLERANCE_PX) ** 2))
        * (_STRAIGHT_WEIGHT + (1.0 - _STRAIGHT_WEIGHT) * path.bent)
    )
    return BlobTrack(score, level, members, blobs, circle)


def _path_score(blobs: Blobs, members: NDArray[np.int64], frames: int) -> _PathScore | None:
    """Score a choice of blobs, whatever circle they lie on; ``None`` where they are few or do not move."""
    place = blobs.plane_px[members]
    extent = float(np.hypot(*np.ptp(place, axis=0)))
    if extent < MOVED_PX or len(members) < _FEWEST:
        return None
    # Motion to and fro on a straight line shows no centre of rotation.
    bent = 1.0 - np.exp(-((_rms_off_line(place) / _BENT_PX) ** 2))
    return _PathScore(_score(blobs, members, frames, extent), float(bent))


def _rms_off_line(place: Floats) -> float:
    """Return the RMS distance of places from the straight line that fits them best, px."""
    return float(np.sqrt(max(np.linalg.eigvalsh(np.cov(place.T))[0], 0.0)))


def _score(blobs: Blobs, members: NDArray[np.int64], frames: int, extent: float) -> float:
    """Score blobs by the share of frames that show them, contrast, constancy of size, size and travel."""
    size = blobs.area[members]
    constancy = np.exp(-4.0 * float(np.std(np.log(size))))
    seen = len(set(blobs.frame[members])) / frames
    travel = 1.0 - np.exp(-extent / 10.0)
    return float(seen**2 * median(blobs.contrast[members]) * constancy * median(size) ** 0.25 * (0.1 + travel))


def resting_track(
    blobs: Blobs, images: Sequence[Image], level: float, through: NDArray[np.intp] | None = None
) -> BlobTrack | None:
    """Return the blob that stands out most, for a clip in which nothing moves.

    Parameters
    ----------
    blobs : Blobs
        The blobs of all images.
    images : sequence of ndarray
        (h, w, 3) the frames.
    level : float
        Contrast at which the blobs were thresholded.
    through : ndarray, optional
        Indices of the blobs of the first picture that may be the mark.

    Returns
    -------
    BlobTrack or None
        ``None`` where there are no blobs.
    """
    if not len(blobs.frame):
        return None
    best: BlobTrack | None = None
    for seed in np.flatnonzero(blobs.frame == blobs.frame[0]) if through is None else through:
        near = np.hypot(*(blobs.plane_px - blobs.plane_px[seed]).T) < MOVED_PX
        alike = np.abs(np.log(blobs.area / blobs.area[seed])) < 0.4
        members = np.flatnonzero(near & alike)
        score = _score(blobs, members, len(images), 0.0) * (0.2 + _skin_share(images[0], blobs, int(seed)))
        if best is None or score > best.score:
            best = BlobTrack(score, level, members, blobs, None)
    return best


def _skin_share(image: Image, blobs: Blobs, seed: int) -> float:
    """Return the share of pixels around a blob with the hue of skin, the only evidence for lips at rest."""
    reach = round(float(np.sqrt(blobs.area[seed])))
    x, y = np.round(blobs.plane_px[seed]).astype(int)
    box = image[max(y - reach, 0) : y + reach + 1, max(x - reach, 0) : x + reach + 1]
    a, b = (cv2.cvtColor(box, cv2.COLOR_BGR2LAB)[..., k].astype(float) - 128.0 for k in (1, 2))
    return float(((a > _SKIN_A[0]) & (a < _SKIN_A[1]) & (b > a) & (b < 3.0 * a)).mean())
