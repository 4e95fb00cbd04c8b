"""Learn the mark's colour from the blobs of one track, and compare it with a declared colour."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from anglecam.data.typing import Image
from anglecam.vision.mark.blob_tracks import BlobTrack
from anglecam.vision.mark.colour import ColourModel, fit_discriminant, lab_of

MIN_CONTRAST = 8.0
"""Lab units by which the mark's colour must stand out; JPEG's chroma errors reach 3 or 4."""
_EDGE_PX = 4
"""Reach of a filmed edge, px."""
_EVERY_PX = 8
"""Distance of the pixels that stand for the rest of the picture."""
_HUE_TOLERANCE = np.radians(25.0)
_COLOURED = 20.0
"""Chroma, units of a*, b*, from which on a declared colour has a hue that can be compared."""
_GREY_TOLERANCE = 35.0
"""Lab units between the declared colour, where it has no hue, and that of the mark: tens of grey levels."""


def learn_colour(
    images: Sequence[Image], maps: Sequence[NDArray[Any]], track: BlobTrack, max_noise: float
) -> ColourModel | None:
    """Learn the colour from a track's blobs; ``None`` where they do not stand out from their neighbourhood."""
    inside, around, elsewhere, contrast = [], [], [], []
    edge = np.ones((2 * _EDGE_PX + 1, 2 * _EDGE_PX + 1), np.uint8)
    for m in track.members:
        t = int(track.blobs.frame[m])
        collar_px = max(8, round(float(np.sqrt(track.blobs.area[m])) / 2.0))
        blob, part = track.blobs.mask(m, maps[t], track.level, _EDGE_PX + collar_px)
        core = cv2.erode(blob, np.ones((3, 3), np.uint8))
        core = core if core.sum() >= 6 else blob
        # Edge pixels belong to neither. Beyond them lies a collar as wide as the mark, without other blobs.
        grown = cv2.dilate(blob, edge)
        collar: Image = cv2.dilate(grown, np.ones((2 * collar_px + 1, 2 * collar_px + 1), np.uint8)) - grown
        collar = collar & (1 - _near_coloured(maps[t], track.level, part, edge))
        inside.append(_picked(images[t][part], core))
        around.append(_picked(images[t][part], collar))
        if len(around[-1]):
            here, beside = _picked(maps[t][part], core), _picked(maps[t][part], collar)
            contrast.append(float(np.median(here) - np.median(beside)))
        some = images[t][::_EVERY_PX, ::_EVERY_PX]
        elsewhere.append(some[~_near_coloured_every(maps[t], np.float32(track.level), _EVERY_PX, _EDGE_PX)])
    parts = [np.concatenate(p) for p in (inside, around, elsewhere)]
    # The contrast to the collar excludes a blush: it stands out from the wall, but not from the face.
    if min(map(len, parts)) < 20 or np.median(contrast) < MIN_CONTRAST:
        return None
    model = fit_discriminant(*parts)
    return model if model.noise < max_noise else None


def _near_coloured(contrast: NDArray[Any], level: float, part: tuple[slice, slice], edge: Image) -> Image:
    """Return the pixels of a part of a picture, bytes, that are within an edge of one above the level."""
    (top, bottom), (left, right) = ((side.start, side.stop) for side in part)
    above, before = max(top - _EDGE_PX, 0), max(left - _EDGE_PX, 0)
    wider = contrast[above : bottom + _EDGE_PX, before : right + _EDGE_PX]
    near: Image = cv2.dilate((wider > level).astype(np.uint8), edge)
    return near[top - above :, left - before :][: bottom - top, : right - left]


@njit("(float32[:, ::1], float32, int64, int64)", cache=True, nogil=True)
def _near_coloured_every(contrast, level, step, reach):  # type: ignore[no-untyped-def]
    """Return for each ``step``-th pixel of each ``step``-th row whether one within reach is above the level."""
    height, width = contrast.shape
    rows, columns = (height + step - 1) // step, (width + step - 1) // step
    near = np.zeros((rows, columns), np.bool_)
    coloured = np.empty(width, np.bool_)
    for i in range(rows):
        coloured[:] = False
        for y in range(max(i * step - reach, 0), min(i * step + reach + 1, height)):
            row = contrast[y]
            for x in range(width):
                coloured[x] |= row[x] > level
        for j in range(columns):
            for x in range(max(j * step - reach, 0), min(j * step + reach + 1, width)):
                near[i, j] |= coloured[x]
    return near


def _picked(picture: NDArray[Any], mask: Image) -> NDArray[Any]:
    """Return the pixels of a picture (h, w) or (h, w, 3) where a mask of bytes is not 0."""
    pixels = picture.reshape(-1, *picture.shape[2:])
    return pixels.take(np.flatnonzero(mask), axis=0)  # indexing with booleans takes several times as long


def is_same_colour(model: ColourModel, rgb: tuple[int, int, int] | None) -> bool:
    """Return whether a colour is the declared one up to shading, which scales (a*, b*) along the hue."""
    if rgb is None:
        return True
    seen, declared = lab_of(model.mean_rgb), lab_of(rgb)
    here, there = np.hypot(*seen[1:]), np.hypot(*declared[1:])
    if there < _COLOURED:
        return bool(np.linalg.norm(seen - declared) < _GREY_TOLERANCE)
    angle = np.arctan2(seen[2], seen[1]) - np.arctan2(declared[2], declared[1])
    return bool(abs((angle + np.pi) % (2.0 * np.pi) - np.pi) < _HUE_TOLERANCE and 0.4 * there < here < 1.8 * there)
