"""The tiles of the body that are rigid and have edges, and their views in frames.

All places are in the plane of motion (`anglecam.camera.lens`), in which the body rotates without changing its shape. A
point of the body that is z nearer to the camera than the pivot rotates around a different centre, where the axis of
rotation is seen at the height z: displaced from the pivot by z·parallax. Each tile therefore has a height.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from anglecam.camera.lens import Lens
from anglecam.data.typing import Floats, Image
from anglecam.threads import map_in_threads
from anglecam.vision.image.median import median_picture
from anglecam.vision.image.transforms import rotate_each, rotation
from anglecam.vision.registration.appearance import TileViews
from anglecam.vision.registration.axis_view import AxisView

TILE_SIDE_PX = 16
"""Side of a tile, px."""
_MAX_TILES = 40
_LOOSE = 6.0
"""Spread of a pixel between frames rotated back, in units of the noise, beyond which it is not rigid or not lit
alike."""
_MAX_LOOSE_SHARE = 0.1
"""Largest share of such pixels in a tile."""
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
_STRIP_ROWS = 16
"""Rows of a strip of pictures that are superposed at a time."""


@dataclass(frozen=True)
class FrameView:
    """A frame, and the body's coarse place in it."""

    image: Image
    turn: float
    """Counter-clockwise as seen, from the reference, rad."""
    pivot_px: Floats
    """(2,) of this frame in the plane of motion, px."""
    turn_per_row: float = 0.0
    """Rotation of the body while the rolling shutter advances by one row, rad."""
    row: float = 0.0
    """Row whose exposure ``turn`` refers to."""
    pivot_covariance_px2: Floats | None = None
    """(2, 2) covariance of the pivot between frames, px²; ``None`` where the camera does not move."""


@dataclass(frozen=True, eq=False)
class MotionPlane:
    """The plane of motion as seen by the pixels of one clip."""

    lens: Lens
    ground: Floats
    """(height, width, 2) place of each pixel in the plane, px."""
    stretch: float
    """Largest number of picture pixels that one unit of length in the plane covers."""
    axis: AxisView
    """How the axis of rotation is seen."""


@dataclass(frozen=True)
class Tiles:
    """Square tiles of the body in the reference frame."""

    corners: Floats
    """(tiles, 2) upper left corners, px; the tile with the most information first."""
    heights: Floats
    """(tiles,) towards the camera, px; zero where all heights share one centre."""


def motion_plane(lens: Lens, size: tuple[int, int]) -> MotionPlane:
    """Map the pixels of a picture of (width, height) to the plane of motion."""
    x, y = np.meshgrid(np.arange(size[0], dtype=float), np.arange(size[1], dtype=float))
    ground = np.ascontiguousarray(lens.rectify(np.stack([x, y], axis=-1)))
    steps = [np.hypot(*np.moveaxis(np.diff(ground, axis=axis), -1, 0)).min() for axis in (0, 1)]
    return MotionPlane(lens, ground, 1.0 / max(min(steps), 0.1), AxisView(lens.parallax))


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
    spread_as_filmed = _spread_as_filmed(frames)
    smooth = cv2.GaussianBlur(mean, (0, 0), 0.7)
    along_x, along_y = (
        cv2.Scharr(smooth, cv2.CV_32F, *axis, scale=1 / 32).reshape(mean.shape) for axis in ((1, 0), (0, 1))
    )
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    arm_x, arm_y = (x - pivot_px[0])[..., None], (y - pivot_px[1])[..., None]
    weight = whole[..., None] / (noise**2 + spread**2)
    information = _by_tile(((along_y * arm_x - along_x * arm_y) ** 2 * weight).sum(axis=2)).sum(axis=(1, 3))
    noise_gradient = _NOISE_GRADIENT * (np.pi / 2.0) / len(frames) * noise**2  # the median's variance is π/2 the mean's
    apparent = _by_tile((noise_gradient * (arm_x**2 + arm_y**2) * weight).sum(axis=2)).sum(axis=(1, 3))
    loose = _by_tile(((spread.max(axis=2) > _LOOSE * noise) | ~whole).astype(np.float32))
    rigid = loose.mean(axis=(1, 3)) < _MAX_LOOSE_SHARE
    # Scenery does not rotate: it varies less as filmed than rotated back.
    as_filmed, rotated_back = (_by_tile((part**2).sum(axis=2)).sum(axis=(1, 3)) for part in (spread_as_filmed, spread))
    has_edges = information > _MIN_EDGES * apparent
    worth = np.where(rigid & has_edges & (as_filmed > _MIN_STEADIER * rotated_back), information, 0.0)
    best = [k for k in np.argsort(worth, axis=None)[::-1][:_MAX_TILES] if worth.flat[k] > 0]
    column_row = np.array([[k % worth.shape[1], k // worth.shape[1]] for k in best], dtype=float)
    return Tiles((TILE_SIDE_PX * column_row).reshape(-1, 2), heights.ravel()[best])


def view_tiles(
    corners: Floats, heights: Floats, frames: Sequence[FrameView], plane: MotionPlane, pivot_px: Floats
) -> tuple[TileViews, Floats]:
    """Collect the pixels of tiles, with a small margin, from frames.

    Parameters
    ----------
    corners : ndarray
        (tiles, 2) in the reference frame, px.
    heights : ndarray
        (tiles,) px.
    frames : sequence of FrameView
        One frame or several.
    plane : MotionPlane
        Place of each pixel.
    pivot_px : ndarray
        (2,) in the reference frame, px.

    Returns
    -------
    views : TileViews
        Every tile in the first frame, then in the second, and so on.
    centres_px : ndarray
        (views, 2) the tiles' middles in the picture, px.
    """
    offsets, values, counts, centres = [], [], [], []
    parallax = heights[:, None] * plane.axis.parallax
    reach = tile_reach(plane)
    for f in frames:
        middles = tile_middles(corners, parallax, f, plane, pivot_px)
        offset, value, count = _gather(
            f.image,
            plane.ground,
            middles,
            reach,
            f.pivot_px + parallax,
            f.turn,
            f.turn_per_row,
            f.row,
            corners,
            TILE_SIDE_PX,
            pivot_px + parallax,
        )
        offsets.append(offset)
        values.append(value)
        counts.append(count)
        centres.append(middles)
    starts = np.append(0, np.cumsum(np.concatenate(counts)))
    return TileViews(np.concatenate(offsets), np.concatenate(values), starts), np.concatenate(centres)


def tile_middles(corners: Floats, parallax_px: Floats, view: FrameView, plane: MotionPlane, pivot_px: Floats) -> Floats:
    """Return the places of the tiles' middles in the picture of a frame.

    Parameters
    ----------
    corners : ndarray
        (tiles, 2) in the reference frame, px.
    parallax_px : ndarray
        (tiles, 2) displacement of the tiles' centres of rotation from the pivot, px.
    view : FrameView
        The frame.
    plane : MotionPlane
        Place of each pixel.
    pivot_px : ndarray
        (2,) in the reference frame, px.

    Returns
    -------
    ndarray
        (tiles, 2) px.
    """
    arm = corners + TILE_SIDE_PX / 2 - pivot_px - parallax_px
    middles = plane.lens.distort(arm @ rotation(view.turn) + view.pivot_px + parallax_px)
    if view.turn_per_row:
        extra = view.turn_per_row * (middles[:, 1] - view.row)
        middles = plane.lens.distort(rotate_each(arm, view.turn + extra) + view.pivot_px + parallax_px)
    return middles


def tile_reach(plane: MotionPlane) -> float:
    """Return the distance from a tile's middle along both axes of the picture within which its pixels are, px."""
    return (0.71 * TILE_SIDE_PX + 1.5) * plane.stretch


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
        pile = np.empty((len(frames), *middle[rows].shape), np.float32)
        for f, back in zip(frames, pile, strict=True):
            places = plane.lens.distort(arms @ rotation(f.turn) + f.pivot_px + parallax)
            if f.turn_per_row:
                extra = f.turn_per_row * (places[:, 1] - f.row)
                places = plane.lens.distort(rotate_each(arms, f.turn + extra) + f.pivot_px + parallax)
            at_x, at_y = places.astype(np.float32).T.reshape(2, *back.shape[:2])
            back[:] = cv2.remap(f.image, at_x, at_y, cv2.INTER_LINEAR).reshape(back.shape)
            whole[rows] &= (at_x >= 0) & (at_y >= 0) & (at_x <= width - 1) & (at_y <= height - 1)
        middle[rows], spread[rows] = _median_and_spread(pile)

    map_in_threads(fill, _strips(len(x)))
    return middle, spread, whole


def _spread_as_filmed(frames: Sequence[FrameView]) -> Image:
    """Return the robust standard deviation of each pixel between frames as they were filmed."""
    spread = np.empty(frames[0].image.shape, np.float32)

    def fill(rows: slice) -> None:
        spread[rows] = _median_and_spread(np.stack([f.image[rows] for f in frames]).astype(np.float32))[1]

    map_in_threads(fill, _strips(len(spread)))
    return spread


def _strips(rows: int) -> list[slice]:
    """Return strips of a picture in which a pile of pictures fits into the processor's cache."""
    return [slice(top, top + _STRIP_ROWS) for top in range(0, rows, _STRIP_ROWS)]


def _by_pixel(heights: Floats, shape: tuple[int, int]) -> float | Floats:
    """Return for every pixel the height of its tile, or zero where all heights are zero."""
    if not heights.any():
        return 0.0
    rows, columns = (np.minimum(np.arange(n) // TILE_SIDE_PX, m - 1) for n, m in zip(shape, heights.shape, strict=True))
    return heights[np.ix_(rows, columns)]


def _median_and_spread(pile: Image) -> tuple[Image, Image]:
    """Return the median over the first axis and the robust standard deviation from it."""
    middle: Image = median_picture(pile)
    spread: Image = 1.4826 * median_picture(np.abs(pile - middle))
    return middle, spread


def _by_tile(part: Image, side: int = TILE_SIDE_PX) -> Image:
    """Reshape a picture (h, w) to (rows, side, columns, side), without incomplete tiles."""
    rows, columns = part.shape[0] // side, part.shape[1] // side
    return part[: rows * side, : columns * side].reshape(rows, side, columns, side)


@njit(cache=True, nogil=True)
def _gather(image, ground, middles, reach, pivots_here, turn, per_row, row, corners, side, pivots):  # type: ignore[no-untyped-def]
    """Collect the tiles' pixels: offsets from their pivots in this frame, values, and how many each tile has."""
    most = len(corners) * (int(2 * reach) + 4) ** 2
    offsets, values = np.empty((most, 2)), np.empty((most, image.shape[2]), np.float32)
    counts, count = np.zeros(len(corners), np.int64), 0
    c, s = np.cos(turn), np.sin(turn)
    for t in range(len(corners)):
        top, bottom = max(0, int(middles[t, 1] - reach)), min(image.shape[0], int(middles[t, 1] + reach) + 2)
        left, right = max(0, int(middles[t, 0] - reach)), min(image.shape[1], int(middles[t, 0] + reach) + 2)
        before = count
        for y in range(top, bottom):
            # A row exposed later shows the body rotated further: its pixels are rotated back around the pivot.
            late = per_row * (y - row)
            cl, sl = np.cos(late), np.sin(late)
            for x in range(left, right):
                gx, gy = ground[y, x, 0] - pivots_here[t, 0], ground[y, x, 1] - pivots_here[t, 1]
                vx, vy = cl * gx - sl * gy, sl * gx + cl * gy
                at_x = pivots[t, 0] + c * vx - s * vy - corners[t, 0]
                at_y = pivots[t, 1] + s * vx + c * vy - corners[t, 1]
                if at_x < -0.5 or at_y < -0.5 or at_x > side + 0.5 or at_y > side + 0.5:
                    continue
                offsets[count, 0], offsets[count, 1] = vx, vy
                for channel in range(image.shape[2]):
                    values[count, channel] = image[y, x, channel]
                count += 1
        counts[t] = count - before
    return offsets[:count].copy(), values[:count].copy(), counts
