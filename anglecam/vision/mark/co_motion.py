"""Whether a patch moves with what is around it, as lips do with a face, or past it, as a toy does before a wall."""

from __future__ import annotations

import cv2
import numpy as np

from anglecam.data.typing import Floats, Image
from anglecam.vision.image.transforms import rotation

_OWN, _AROUND = 0.8, 1.8
"""Of the root of its area: within the first a patch is itself, up to the second lie its surroundings."""
_NOISE = 2.0
"""Grey levels that any two pictures differ by: where nothing is to be seen around a patch, nothing is to be told."""


def co_motion_share(
    first: Image, second: Image, at_first: Floats, at_second: Floats, stayed: Floats, turn: float, area_px2: float
) -> float:
    """Compare the surroundings of a patch in two frames, once where the patch went and once where they were.

    Parameters
    ----------
    first, second : ndarray
        (h, w, 3) the frames.
    at_first, at_second : ndarray
        (2,) centre of the patch in each, px.
    stayed : ndarray
        (2,) where the second frame shows what does not move and was at ``at_first``, px.
    turn : float
        Of the patch from the first to the second about its own centre, rad, counter-clockwise as seen.
    area_px2 : float
        Of the patch.

    Returns
    -------
    float
        Difference of the surroundings that stay, over the sum of that and the difference of those that go along:
        near 1 for a part of a larger body, about 0.5 or less for a body of its own.
    """
    size = float(np.sqrt(area_px2))
    half = int(np.ceil(_AROUND * size))
    grid = np.stack(np.meshgrid(np.arange(-half, half + 1.0), np.arange(-half, half + 1.0)), axis=-1)
    away = np.hypot(*(grid - (at_second - stayed)).transpose(2, 0, 1))
    around = (np.hypot(*grid.transpose(2, 0, 1)) > _OWN * size) & (away > _OWN * size)
    here = _sampled(first, at_first + grid)
    gone, left = _sampled(second, at_second + grid @ rotation(turn)), _sampled(second, stayed + grid)
    inside = around & (here >= 0.0).all(axis=2) & (gone >= 0.0).all(axis=2) & (left >= 0.0).all(axis=2)
    if inside.sum() < area_px2 / 4.0:
        return 0.5
    moved, stays = (float(np.abs(other[inside] - here[inside]).mean()) + _NOISE for other in (gone, left))
    return stays / (stays + moved)


def _sampled(image: Image, places: Floats) -> Floats:
    """Sample an image, -1 where there is none."""
    x, y = places.astype(np.float32).transpose(2, 0, 1)
    outside = (x < 0) | (y < 0) | (x > image.shape[1] - 1) | (y > image.shape[0] - 1)
    picked: Floats = cv2.remap(image, x, y, cv2.INTER_LINEAR).astype(float)
    picked[outside] = -1.0
    return picked
