"""Whether the surroundings of a blob move with it.

They do for a part of a larger body, as for lips in a face. They do not for a separate body, as for a toy that moves
past a wall.
"""

from __future__ import annotations

import cv2
import numpy as np

from anglecam.data.typing import Floats, Image
from anglecam.vision.image.transforms import rotation

_BLOB_RADIUS, _SURROUNDINGS_RADIUS = 0.8, 1.8
"""In units of the root of the blob's area: the blob lies within the first, its surroundings between the two."""
_MAX_SIDE = 41
"""Most points along a side of the grid on which surroundings are compared: a large blob needs no finer one."""
_NOISE = 2.0
"""Grey levels by which any two pictures differ. Featureless surroundings then score near 0.5, which is undecided."""


def co_motion_share(
    first: Image,
    second: Image,
    first_px: Floats,
    second_px: Floats,
    static_px: Floats,
    turn: float,
    area_px2: float,
) -> float:
    """Compare a blob's surroundings in two frames, once as if they moved with the blob and once as if they stayed.

    Parameters
    ----------
    first, second : ndarray
        (h, w, 3) the frames.
    first_px, second_px : ndarray
        (2,) centre of the blob in each, px.
    static_px : ndarray
        (2,) place in the second frame of static scenery that was at ``first_px`` in the first, px.
    turn : float
        Rotation of the blob around its centre from the first frame to the second, rad, counter-clockwise as seen.
    area_px2 : float
        Area of the blob, px².

    Returns
    -------
    float
        D_static / (D_static + D_moving), with D the mean absolute difference of the surroundings under each
        assumption. It is near 1 for a part of a larger body, and 0.5 or less for a separate body. It is 0.5 where too
        few of the surroundings are in the picture.
    """
    size = float(np.sqrt(area_px2))
    half = int(np.ceil(_SURROUNDINGS_RADIUS * size))
    line = np.linspace(-half, half, min(2 * half + 1, _MAX_SIDE))
    grid = np.stack(np.meshgrid(line, line), axis=-1)
    from_moved_blob = np.hypot(*(grid - (second_px - static_px)).transpose(2, 0, 1))
    outside = (np.hypot(*grid.transpose(2, 0, 1)) > _BLOB_RADIUS * size) & (from_moved_blob > _BLOB_RADIUS * size)
    before = _sampled(first, first_px + grid)
    moving, static = _sampled(second, second_px + grid @ rotation(turn)), _sampled(second, static_px + grid)
    inside = outside & (before >= 0.0).all(axis=2) & (moving >= 0.0).all(axis=2) & (static >= 0.0).all(axis=2)
    if inside.sum() * (line[1] - line[0]) ** 2 < area_px2 / 4.0:
        return 0.5
    if_moving, if_static = (float(np.abs(after[inside] - before[inside]).mean()) + _NOISE for after in (moving, static))
    return if_static / (if_static + if_moving)


def _sampled(image: Image, places: Floats) -> Floats:
    """Sample an image at places (h, w, 2); -1 outside the image."""
    x, y = places.astype(np.float32).transpose(2, 0, 1)
    outside = (x < 0) | (y < 0) | (x > image.shape[1] - 1) | (y > image.shape[0] - 1)
    picked: Floats = cv2.remap(image, x, y, cv2.INTER_LINEAR).astype(float)
    picked[outside] = -1.0
    return picked
