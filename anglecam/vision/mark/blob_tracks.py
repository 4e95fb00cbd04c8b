"""Track of one blob through sampled frames: on a circle, or at rest in a clip where nothing moves.

A track is scored by the share of frames in which the blob is seen, by how constant its size is, by its contrast,
and by whether its surroundings move with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats, Image
from anglecam.vision.mark.blob_circles import MOVED_PX, collect_on_circles, draw_circles
from anglecam.vision.mark.blobs import Blobs
from anglecam.vision.mark.co_motion import co_motion_share

_SKIN_A = (4.0, 24.0)
"""Range of a* of skin of every complexion; its b* is one to three times its a*."""
_AT_REST = 0.1
"""Score of a blob at rest relative to one that travels far."""
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
    if len(images) < 2 or not len(blobs.frame):
        return None
    longest = 1.5 * float(np.hypot(*images[0].shape[:2]))
    circles, typical = draw_circles(blobs, hint, longest, through)
    scores, members = collect_on_circles(blobs, len(images), circles, typical)
    best: BlobTrack | None = None
    co_motion: dict[tuple[int, int], float] = {}
    for k in range(len(scores)):
        if scores[k] <= (0.0 if best is None else best.score):  # the factor below is at most 1
            continue
        taken = members[k][members[k] >= 0]
        if through is not None and not np.isin(taken, through).any():
            continue
        track = BlobTrack(float(scores[k]), level, taken, blobs, (circles[k, :2], float(circles[k, 2])))
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
        score = _score_at_rest(blobs, members, len(images)) * (0.2 + _skin_share(images[0], blobs, int(seed)))
        if best is None or score > best.score:
            best = BlobTrack(score, level, members, blobs, None)
    return best


def _score_at_rest(blobs: Blobs, members: NDArray[np.int64], frames: int) -> float:
    """Score blobs by the share of frames that show them, contrast, constancy of size and size."""
    size = blobs.area[members]
    constancy = np.exp(-4.0 * float(np.std(np.log(size))))
    seen = len(set(blobs.frame[members])) / frames
    return float(seen**2 * np.median(blobs.contrast[members]) * constancy * np.median(size) ** 0.25 * _AT_REST)


def _skin_share(image: Image, blobs: Blobs, seed: int) -> float:
    """Return the share of pixels around a blob with the hue of skin, the only evidence for lips at rest."""
    reach = round(float(np.sqrt(blobs.area[seed])))
    x, y = np.round(blobs.plane_px[seed]).astype(int)
    box = image[max(y - reach, 0) : y + reach + 1, max(x - reach, 0) : x + reach + 1]
    a, b = (cv2.cvtColor(box, cv2.COLOR_BGR2LAB)[..., k].astype(float) - 128.0 for k in (1, 2))
    return float(((a > _SKIN_A[0]) & (a < _SKIN_A[1]) & (b > a) & (b < 3.0 * a)).mean())
