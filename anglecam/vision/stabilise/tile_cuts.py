"""Pixels of the scenery's tiles, cut out of frames at the expected places."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats, Image
from anglecam.vision.registration.appearance import TileViews
from anglecam.vision.stabilise.scenery import Scenery
from anglecam.vision.stabilise.windows import WINDOW_SIDE_PX, displacements

TILE_MARGIN_PX = 2
"""Margin around a tile, px, that contains the corners of a rolled tile."""


@dataclass(frozen=True)
class TileCuts:
    """Pixels of tiles, with a margin, in a number of frames."""

    pixels: Floats
    """(frames, tiles, m, 2) their places, px."""
    values: NDArray[np.float32]
    """(frames, tiles, m) their brightness."""
    whole: NDArray[np.bool_]
    """(frames, tiles) whether all of the tile is in the picture."""


def brightness(image: Image) -> Image:
    """Convert blue, green, red (h, w, 3) to grey (h, w), which codecs store at full resolution; keep grey images."""
    planes = 1 if image.ndim == 2 else image.shape[2]
    return image.reshape(image.shape[:2]) if planes == 1 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)


def cut_tiles(pictures: Sequence[Image], scenery: Scenery, shifts: Floats, rolls: Floats) -> TileCuts:
    """Cut the tiles out of frames, each displaced by whole pixels.

    Parameters
    ----------
    pictures : sequence of ndarray
        (h, w) brightness.
    scenery : Scenery
        The tiles.
    shifts, rolls : ndarray
        (frames, 2) px and (frames,) rad, approximate.

    Returns
    -------
    TileCuts
        Of every tile in every frame.
    """
    side = WINDOW_SIDE_PX + 2 * TILE_MARGIN_PX
    y, x = np.mgrid[0:side, 0:side].reshape(2, -1)
    height, width = pictures[0].shape
    arms = scenery.centres_px - scenery.origin_px
    middles = scenery.centres_px + displacements(arms, shifts, rolls).swapaxes(0, 1)
    corners = np.round(middles - (side - 1) / 2.0).astype(int)
    whole = np.all((corners >= 0) & (corners <= [width - side, height - side]), axis=-1)
    corners = np.clip(corners, 0, [width - side, height - side])
    pixels = corners[:, :, None] + np.stack([x, y], axis=-1)
    values = np.stack([p[at[..., 1], at[..., 0]] for p, at in zip(pictures, pixels, strict=True)])
    return TileCuts(pixels.astype(float), values.astype(np.float32), whole)


def as_views(offsets: Floats, values: NDArray[np.float32]) -> TileViews:
    """Convert offsets (n, m, 2) and values (n, m) of n views with m pixels each to `TileViews`."""
    count, each = values.shape
    return TileViews(offsets.reshape(-1, 2), values.reshape(-1, 1), np.arange(count + 1) * each)
