"""Whether the camera zooms, or comes nearer: the distances between all parts of the scenery grow alike.

A shift and a roll leave distances as they are, so a zoom is not part of the camera's motion that is corrected
(`anglecam.vision.stabilise.background_motion`): it has to be detected. Small windows are tracked from the first of a
few frames into the others, and a similarity (shift, roll and scale) is fitted to most of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np

from anglecam.data.typing import Floats, Image
from anglecam.vision.image.noise import pixel_noise
from anglecam.vision.stabilise.tile_cuts import brightness
from anglecam.vision.stabilise.windows import TOLERANCE_PX, find_windows, follow_windows, subtract_local_mean

_MIN_WINDOWS = 12
"""Fewest windows from which a scale is estimated; through two of them it always fits."""
_MIN_SHARE = 0.3
"""Least share of the windows that must follow. A textured body may have most of the others."""
_MIN_KNOWN = 0.25
"""Least share of the frames in which a scale is found: a body may hide most of the scenery in the others."""
_SIGNIFICANT = 5.0
"""Change of scale, in its standard uncertainties, that counts: a smooth wall determines the scale badly, and the errors
of neighbouring windows are correlated."""
_INNER = (0.05, 0.95)
"""Quantiles taken for the smallest and the largest scale: single frames may be wrong."""
_EDGE_PX = 1.0
"""Displacement at the picture's corners, px, up to which a change of scale does no harm: at the mark it is less, and it
acts along the lever, if the pivot is near the middle, more than across it."""


@dataclass(frozen=True)
class Zoom:
    """A zoom that windows show."""

    factor: float
    """The large scales divided by the small ones."""
    moves: tuple[Floats | None, ...] = field(repr=False)
    """For each picture the (3, 3) similarity from the first one, px; ``None`` where too few windows follow one."""


def camera_zoom(images: Sequence[Image]) -> Zoom | None:
    """Return by which factor the scale of the picture varies.

    Parameters
    ----------
    images : sequence of ndarray
        (h, w, 3) blue, green, red, spread over a clip.

    Returns
    -------
    Zoom or None
        ``None`` where the camera does not zoom, or too little scenery is seen to tell.
    """
    if len(images) < 2:
        return None
    pictures = [subtract_local_mean(brightness(image)) for image in images]
    # slopes that the subtraction removes determine no place
    centres, _ = find_windows(pictures[0], pixel_noise(pictures))
    if len(centres) < _MIN_WINDOWS:
        return None
    found = [_similarity(centres, follow_windows(pictures[0], picture, centres)) for picture in pictures[1:]]
    known = [(float(np.hypot(*move[:2, 0])), sigma) for move, sigma in found if move is not None]
    if not known or len(known) + 1 < _MIN_KNOWN * len(images):
        return None
    low, high = np.quantile([1.0, *(scale for scale, _ in known)], _INNER)
    factor = float(high / low)
    reach = float(np.hypot(*pictures[0].shape[:2])) / 2.0
    sigma = float(np.sqrt(2.0) * np.median([sigma for _, sigma in known]))
    if factor - 1.0 <= max(_EDGE_PX / reach, _SIGNIFICANT * sigma):
        return None
    return Zoom(factor, (np.eye(3), *(move for move, _ in found)))


def _similarity(centres: Floats, moved: Floats) -> tuple[Floats | None, float]:
    """Return the similarity (3, 3) that most windows follow, ``None`` where fewer do, and the sigma of its scale."""
    cv2.setRNGSeed(0)
    matrix, follows = cv2.estimateAffinePartial2D(
        centres, centres + moved, method=cv2.RANSAC, ransacReprojThreshold=2.0 * TOLERANCE_PX, maxIters=500
    )
    if matrix is None or follows.mean() < _MIN_SHARE or follows.sum() < _MIN_WINDOWS:
        return None, float("nan")
    kept = follows.ravel().astype(bool)
    start, end = centres[kept], (centres + moved)[kept]
    off = end - (start @ matrix[:, :2].T + matrix[:, 2])
    freedom = max(2 * len(start) - 4, 1)
    spread = float(((start - start.mean(axis=0)) ** 2).sum())
    return np.vstack([matrix, [0.0, 0.0, 1.0]]), float(np.sqrt((off**2).sum() / freedom / spread))
