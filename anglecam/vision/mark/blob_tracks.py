"""Track of one blob through sampled frames: on a circle, or at rest in a clip where nothing moves.

A track is scored by what its blobs are like (`anglecam.vision.mark.blob_scores`), and by whether their surroundings
move with them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats, Image
from anglecam.vision.mark.blob_circles import MOVED_PX, circle_of, draw_blobs
from anglecam.vision.mark.blob_scores import score_blobs, score_circles
from anglecam.vision.mark.blobs import Blobs
from anglecam.vision.mark.co_motion import co_motion_share

_SKIN_A = (4.0, 24.0)
"""Range of a* of skin of every complexion; its b* is one to three times its a*."""
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
    frames = len(images)
    if frames < 2:
        return None
    longest = 1.5 * float(np.hypot(*images[0].shape[:2]))
    drawn = [(circle_of(blobs.plane_px[draw], hint, longest), draw) for draw in draw_blobs(blobs, through)]
    circles = [(circle, [*draw, -1][:3]) for circle, draw in drawn if circle is not None]
    if not circles:
        return None
    centres, radii = np.array([centre for (centre, _), _ in circles]), np.array([radius for (_, radius), _ in circles])
    scores, members = score_circles(blobs, np.array([draw for _, draw in circles]), centres, radii, frames)
    best: BlobTrack | None = None
    co_motion: dict[tuple[int, int], float] = {}
    for (circle, _), score, some in zip(circles, scores.tolist(), members, strict=True):
        if score < 0.0 or (best is not None and score <= best.score):  # the factor below is at most 1
            continue
        track = BlobTrack(score, level, some[some >= 0], blobs, circle)
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
        share = len(set(blobs.frame[members])) / len(images)
        score = score_blobs(blobs.area[members], blobs.contrast[members], share, 0.0)
        score *= 0.2 + _skin_share(images[0], blobs, int(seed))
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
