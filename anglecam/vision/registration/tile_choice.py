"""Which tiles of the picture are rigid parts of the body and have edges.

Frames are rotated back onto one another by their coarse angles. What then stands still, and moves as filmed, is the
body.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from anglecam.data.typing import Floats, Image
from anglecam.threads import map_in_threads
from anglecam.vision.image.spread import median_and_spread
from anglecam.vision.image.transforms import rotate_each
from anglecam.vision.registration.tiles import TILE_SIDE_PX, FrameView, MotionPlane, Tiles

_MAX_TILES = 40
_LOOSE = 6.0
"""Spread of a pixel between frames rotated back, in units of the noise, beyond which it is not rigid or not lit
alike."""
_MAX_LOOSE_SHARE = 0.1
"""Largest share of such pixels in a tile."""
_QUIET = 0.1
"""Quantile of the spread of what moves that counts as its noise: whatever glitters or is no part of the body has
more."""
_MIN_STEADIER = 1.5
"""Least ratio of squared spreads, as filmed over rotated back, of a tile that belongs to the body."""
_NOISE_GRADIENT = 0.054
"""Squared gradient of white noise, smoothed and differentiated as here, relative to its variance."""
_MIN_EDGES = 3.0
"""Least information of a tile, relative to what the noise of a plain tile appears to have. A plain wall would be taken
for a part of the body, and determine the pivot wrongly."""
_MAX_HEIGHT = 0.3
"""Largest height of a part of the body, as a share of half the picture's diagonal."""
_HEIGHT_STEP_PX = 1.0
"""Displacement between neighbouring heights that are tried, px."""
_PILE_ROWS = 16
"""Rows of pictures that are superposed at a time: they fit into the processor's cache."""
_INFORMATION_ROWS = 4 * TILE_SIDE_PX
"""Rows of the picture whose gradients are computed at a time."""
_MARGIN = 8
"""Rows beyond them on which their gradients depend, at most."""


def choose_tiles(frames: Sequence[FrameView], plane: MotionPlane, pivot_px: Floats, noise: float) -> Tiles:
    """Find the tiles that are rigid and have edges.

    Parameters
    ----------
    frames : sequence of FrameView
        Frames at different angles.
    plane : MotionPlane
        Place of each pixel.
    pivot_px : ndarray
        (2,) in the reference frame, px.
    noise : float
        Standard deviation of the pixels, grey levels.

    Returns
    -------
    Tiles
        At most 40, those with the most information on the angle.
    """
    height, width = frames[0].image.shape[:2]
    heights = _find_heights(frames, plane, pivot_px)
    mean, spread, whole = _stack(frames, plane, pivot_px, _by_pixel(heights, (height, width)))
    # Scenery does not rotate: it varies less as filmed than rotated back.
    as_filmed, rotated_back = (
        _by_tile((part**2).sum(axis=2)).sum(axis=(1, 3)) for part in (_spread_as_filmed(frames), spread)
    )
    moves = as_filmed > _MIN_STEADIER * rotated_back
    noise = _noise_of_moving(spread, whole, moves, noise)
    noise_gradient = _NOISE_GRADIENT * (np.pi / 2.0) / len(frames) * noise**2  # the median's variance is π/2 the mean's
    weight = whole[..., None] / (noise**2 + spread**2)
    parts = map_in_threads(
        lambda rows: _information(mean, weight, pivot_px, noise_gradient, rows), _strips(height, _INFORMATION_ROWS)
    )
    information, apparent = (np.concatenate(part) for part in zip(*parts, strict=True))
    loose = _by_tile(((spread.max(axis=2) > _LOOSE * noise) | ~whole).astype(np.float32))
    rigid = loose.mean(axis=(1, 3)) < _MAX_LOOSE_SHARE
    has_edges = information > _MIN_EDGES * apparent
    worth = np.where(rigid & has_edges & moves, information, 0.0)
    best = [k for k in np.argsort(worth, axis=None)[::-1][:_MAX_TILES] if worth.flat[k] > 0]
    column_row = np.array([[k % worth.shape[1], k // worth.shape[1]] for k in best], dtype=float)
    return Tiles((TILE_SIDE_PX * column_row).reshape(-1, 2), heights.ravel()[best])


def _noise_of_moving(spread: Image, whole: NDArray[np.bool_], moves: NDArray[np.bool_], noise: float) -> float:
    """Return the noise of what moves, grey levels: a codec copies scenery at rest without noise, but not a body."""
    moving = np.repeat(np.repeat(moves, TILE_SIDE_PX, axis=0), TILE_SIDE_PX, axis=1)
    part = tuple(slice(n) for n in moving.shape)
    seen = spread[part][moving & whole[part]]
    return max(noise, float(np.quantile(seen, _QUIET))) if seen.size else noise


def _find_heights(frames: Sequence[FrameView], plane: MotionPlane, pivot_px: Floats) -> Floats:
    """Find the height, px, at which each tile of the picture varies least between frames rotated back."""
    height, width = frames[0].image.shape[:2]
    slope = float(np.hypot(*plane.axis.parallax))
    if slope == 0.0:
        return np.zeros((height // TILE_SIDE_PX, width // TILE_SIDE_PX))
    grey = [replace(f, image=f.image.mean(axis=2, keepdims=True).astype(np.uint8)) for f in frames[::2]]
    amplitude = max(float(np.ptp([f.turn for f in frames])) / 2.0, 1e-3)
    tallest = _MAX_HEIGHT * float(np.hypot(*(np.array([width, height]) / 2.0)))
    steps = int(np.clip(tallest * slope * amplitude / _HEIGHT_STEP_PX, 1, 10))
    heights = np.linspace(-tallest, tallest, 2 * steps + 1)
    spreads = (_stack(grey, plane, pivot_px, z, 2)[1][..., 0] for z in heights)
    variation = np.stack([_by_tile(spread**2, TILE_SIDE_PX // 2).mean(axis=(1, 3)) for spread in spreads])
    # The vertex of the parabola through the height of least variation and its neighbours.
    at = np.clip(variation.argmin(axis=0), 1, len(heights) - 2)
    before, here, after = (np.take_along_axis(variation, (at + k)[None], axis=0)[0] for k in (-1, 0, 1))
    curvature = np.maximum(before - 2.0 * here + after, 1e-9)
    return heights[at] + np.clip(0.5 * (before - after) / curvature, -1.0, 1.0) * (heights[1] - heights[0])


def _stack(
    frames: Sequence[FrameView], plane: MotionPlane, pivot_px: Floats, heights: float | Floats, step: int = 1
) -> tuple[Image, Image, NDArray[np.bool_]]:
    """Rotate frames back to the reference and return the pixel-wise median, the spread, and the pixels all frames show.

    Parameters
    ----------
    heights : float or ndarray
        One height for all pixels, or one for each, px.
    step : int
        Every ``step``-th pixel along both axes is computed.
    """
    height, width, planes = frames[0].image.shape
    x, y = np.meshgrid(np.arange(0.0, width, step), np.arange(0.0, height, step))
    middle, spread = np.empty((2, *x.shape, planes), np.float32)
    whole = np.ones(x.shape, bool)

    def fill(rows: slice) -> None:
        here = heights[rows] if isinstance(heights, np.ndarray) else heights
        parallax = np.reshape(here, (-1, 1)) * plane.axis.parallax
        arms = np.stack([x[rows], y[rows]], axis=-1).reshape(-1, 2) - pivot_px - parallax
        pile = np.empty((len(frames), *middle[rows].shape), np.uint8)
        for f, back in zip(frames, pile, strict=True):
            places = plane.lens.distort(_turned(arms, f.turn, f.pivot_px + parallax))
            if f.turn_per_row:
                extra = f.turn_per_row * (places[:, 1] - f.row)
                places = plane.lens.distort(rotate_each(arms, f.turn + extra) + f.pivot_px + parallax)
            at = places.astype(np.float32).reshape(*back.shape[:2], 2)
            seen = cv2.remap(f.image, at, None, cv2.INTER_LINEAR)  # type: ignore[call-overload]
            back[:] = seen.reshape(back.shape)
            _exclude_outside(at, width, height, whole[rows])
        middle[rows], spread[rows] = median_and_spread(pile)

    map_in_threads(fill, _strips(len(x), _PILE_ROWS))
    return middle, spread, whole


def _spread_as_filmed(frames: Sequence[FrameView]) -> Image:
    """Return the robust standard deviation of each pixel between frames as they were filmed."""
    spread = np.empty(frames[0].image.shape, np.float32)

    def fill(rows: slice) -> None:
        spread[rows] = median_and_spread(np.stack([f.image[rows] for f in frames]))[1]

    map_in_threads(fill, _strips(len(spread), _PILE_ROWS))
    return spread


def _information(
    mean: Image, weight: Image, pivot_px: Floats, noise_gradient: float, rows: slice
) -> tuple[Image, Image]:
    """Return the information on the angle by tiles in rows of the picture, and what noise alone appears to have."""
    wide = slice(max(rows.start - _MARGIN, 0), rows.stop + _MARGIN)
    smooth = cv2.GaussianBlur(mean[wide], (0, 0), 0.7)
    weight, top = weight[rows], rows.start - wide.start
    along_x, along_y = (
        cv2.Scharr(smooth, cv2.CV_32F, *axis, scale=1 / 32).reshape(mean[wide].shape)[top : top + len(weight)]
        for axis in ((1, 0), (0, 1))
    )
    arm_x = (np.arange(weight.shape[1], dtype=np.float32) - pivot_px[0])[:, None]
    arm_y = (np.arange(rows.start, rows.start + len(weight), dtype=np.float32) - pivot_px[1])[:, None, None]
    of_tile = _by_tile(((along_y * arm_x - along_x * arm_y) ** 2 * weight).sum(axis=2)).sum(axis=(1, 3))
    return of_tile, _by_tile((noise_gradient * (arm_x**2 + arm_y**2) * weight).sum(axis=2)).sum(axis=(1, 3))


def _strips(rows: int, each: int) -> list[slice]:
    """Return strips of so many rows of a picture."""
    return [slice(top, top + each) for top in range(0, rows, each)]


def _by_pixel(heights: Floats, shape: tuple[int, int]) -> float | Floats:
    """Return for every pixel the height of its tile, or zero where all heights are zero."""
    if not heights.any():
        return 0.0
    rows, columns = (np.minimum(np.arange(n) // TILE_SIDE_PX, m - 1) for n, m in zip(shape, heights.shape, strict=True))
    return heights[np.ix_(rows, columns)]


def _by_tile(part: Image, side: int = TILE_SIDE_PX) -> Image:
    """Reshape a picture (h, w) to (rows, side, columns, side), without incomplete tiles."""
    rows, columns = part.shape[0] // side, part.shape[1] // side
    return part[: rows * side, : columns * side].reshape(rows, side, columns, side)


@njit("(float64[:, ::1], float64, float64[:, ::1])", cache=True, nogil=True, fastmath={"contract"})
def _turned(arms, turn, centres):  # type: ignore[no-untyped-def]
    """Return places (m, 2) whose arms (m, 2) are rotated about centres (m, 2) or about one (1, 2)."""
    places = np.empty_like(arms)
    c, s = np.cos(turn), np.sin(turn)
    for m in range(len(arms)):
        k = m if len(centres) > 1 else 0
        places[m, 0] = c * arms[m, 0] + s * arms[m, 1] + centres[k, 0]
        places[m, 1] = c * arms[m, 1] - s * arms[m, 0] + centres[k, 1]
    return places


@njit("(float32[:, :, ::1], int64, int64, boolean[:, ::1])", cache=True, nogil=True)
def _exclude_outside(places, width, height, whole):  # type: ignore[no-untyped-def]
    """Mark in ``whole`` (h, w) the places (h, w, 2) that are outside the picture."""
    for y in range(places.shape[0]):
        for x in range(places.shape[1]):
            across, down = places[y, x, 0], places[y, x, 1]
            whole[y, x] &= (across >= 0) & (down >= 0) & (across <= width - 1) & (down <= height - 1)
