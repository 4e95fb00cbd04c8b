"""Where the head is rigid and has edges: its best tiles, and what a frame shows of them.

All is told in the plane of motion (`anglecam.camera.lens`), in which the head turns without changing its shape. A point of
the head z nearer to the camera than the pivot turns, in a tilted view, about a centre of its own, z·parallax beside
the pivot's: a tile has a height.
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
from anglecam.vision.image.median import median_picture
from anglecam.vision.image.transforms import rotation
from anglecam.vision.registration.appearance import TileViews

TILE_SIDE_PX = 16
_MAX_TILES = 40
_LOOSE = 6.0
"""Robust standard deviations of the noise beyond which a place of the stack is not rigid, or not lit alike."""
_LOOSE_SHARE = 0.1
_STEADIER = 1.5
"""Ratio of squared spreads, as filmed over turned back, from which on a tile belongs to the head."""
_TALLEST = 0.3
"""Height of a part of the head, as a share of half the picture's diagonal."""
_HEIGHT_STEP_PX = 1.0
"""Displacement between neighbouring heights that are tried, px."""


@dataclass(frozen=True)
class FrameView:
    """A frame, and where the coarse measurement has the head in it."""

    image: Image
    turn: float
    """Counter-clockwise as seen, from the reference, rad."""
    pivot_px: Floats
    """(2,) of this frame in the plane of motion, px."""
    turn_per_row: float = 0.0
    """What the head turns while the shutter goes on by a row, rad."""
    row: float = 0.0
    """To whose exposure ``turn`` refers."""
    wander_px2: Floats | None = None
    """(2, 2) covariance of this frame's pivot against the clip's, where the camera moves, px²."""


@dataclass(frozen=True, eq=False)
class MotionPlane:
    """The plane of motion as the pixels of one clip see it."""

    lens: Lens
    ground: Floats
    """(height, width, 2) where in the plane each pixel lies, px."""
    stretch: float
    """Pixels of the picture that a length of one in the plane spans at most."""


@dataclass(frozen=True)
class Tiles:
    """Squares of the head in the reference frame."""

    corners: Floats
    """(tiles, 2) upper left corners, px, the most telling tile first."""
    heights: Floats
    """(tiles,) towards the camera, px; zero in a view that is not tilted."""


def motion_plane(lens: Lens, size: tuple[int, int]) -> MotionPlane:
    """Lay a picture of (width, height) pixels into the plane of motion."""
    x, y = np.meshgrid(np.arange(size[0], dtype=float), np.arange(size[1], dtype=float))
    ground = np.ascontiguousarray(lens.rectify(np.stack([x, y], axis=-1)))
    steps = [np.hypot(*np.moveaxis(np.diff(ground, axis=axis), -1, 0)).min() for axis in (0, 1)]
    return MotionPlane(lens, ground, 1.0 / max(min(steps), 0.1))


def choose_tiles(glimpses: Sequence[FrameView], plane: MotionPlane, pivot_px: Floats, noise: float) -> Tiles:
    """Find where the head is rigid and has edges.

    Parameters
    ----------
    glimpses : sequence of Glimpse
        Frames at turns that differ.
    plane : Plane
        What lies where.
    pivot_px : ndarray
        (2,) in the reference frame, px.
    noise : float
        Standard deviation of the pixels, grey levels.

    Returns
    -------
    Tiles
        At most `MOST_TILES`.
    """
    height, width = glimpses[0].image.shape[:2]
    heights = _find_heights(glimpses, plane, pivot_px)
    look, spread, whole = _stack(glimpses, plane, pivot_px, _by_pixel(heights, (height, width)))
    unturned = _middle_and_spread(np.stack([g.image for g in glimpses]).astype(np.float32))[1]
    smooth = cv2.GaussianBlur(look, (0, 0), 0.7)
    along_x, along_y = (
        cv2.Scharr(smooth, cv2.CV_32F, *axis, scale=1 / 32).reshape(look.shape) for axis in ((1, 0), (0, 1))
    )
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    by_turn = along_y * (x - pivot_px[0])[..., None] - along_x * (y - pivot_px[1])[..., None]
    information = _by_tile((by_turn**2 / (noise**2 + spread**2)).sum(axis=2) * whole)
    loose = _by_tile(((spread.max(axis=2) > _LOOSE * noise) | ~whole).astype(np.float32))
    rigid = loose.mean(axis=(1, 3)) < _LOOSE_SHARE
    # the scenery does not turn: it is steadier as it is filmed
    as_filmed, turned_back = (_by_tile((part**2).sum(axis=2)).sum(axis=(1, 3)) for part in (unturned, spread))
    worth = np.where(rigid & (as_filmed > _STEADIER * turned_back), information.sum(axis=(1, 3)), 0.0)
    best = [k for k in np.argsort(worth, axis=None)[::-1][:_MAX_TILES] if worth.flat[k] > 0]
    corners = TILE_SIDE_PX * np.array([[k % worth.shape[1], k // worth.shape[1]] for k in best], dtype=float).reshape(
        -1, 2
    )
    return Tiles(corners, heights.ravel()[best])


def view_tiles(
    corners: Floats, heights: Floats, glimpses: Sequence[FrameView], plane: MotionPlane, pivot_px: Floats
) -> tuple[TileViews, Floats]:
    """Collect what frames show of tiles, and a little around them.

    Parameters
    ----------
    corners : ndarray
        (tiles, 2) in the reference frame, px.
    heights : ndarray
        (tiles,) px.
    glimpses : sequence of Glimpse
        Of one frame or several.
    plane : Plane
        What lies where.
    pivot_px : ndarray
        (2,) in the reference frame, px.

    Returns
    -------
    views : Views
        Of every tile in the first frame, then in the second, and so on.
    centres_px : ndarray
        (views, 2) the tiles' middles in the picture, px.
    """
    offsets, values, starts, centres = [], [], [0], []
    beside = heights[:, None] * plane.lens.parallax
    reach = (0.71 * TILE_SIDE_PX + 1.5) * plane.stretch
    for g in glimpses:
        arm = corners + TILE_SIDE_PX / 2 - pivot_px - beside
        middle = plane.lens.distort(arm @ rotation(g.turn) + g.pivot_px + beside)
        if g.turn_per_row:
            early = g.turn_per_row * (middle[:, 1] - g.row)
            middle = plane.lens.distort(_each_turned(arm, g.turn + early) + g.pivot_px + beside)
        for one, about, to_side in zip(corners, middle, beside, strict=True):
            offset, value = _gather(
                g.image,
                plane.ground,
                about,
                reach,
                g.pivot_px + to_side,
                g.turn,
                g.turn_per_row,
                g.row,
                one,
                TILE_SIDE_PX,
                pivot_px + to_side,
            )
            offsets.append(offset)
            values.append(value)
            starts.append(starts[-1] + len(offset))
        centres.append(middle)
    return TileViews(np.concatenate(offsets), np.concatenate(values), np.array(starts)), np.concatenate(centres)


def _each_turned(arms: Floats, turns: Floats) -> Floats:
    """Turn each point (n, 2) by its own turn (n,): of whole pictures, without a matrix a pixel."""
    c, s = np.cos(turns), np.sin(turns)
    return np.column_stack([c * arms[:, 0] + s * arms[:, 1], -s * arms[:, 0] + c * arms[:, 1]])


def _find_heights(glimpses: Sequence[FrameView], plane: MotionPlane, pivot_px: Floats) -> Floats:
    """Find the height at which each tile of the picture is steadiest when frames are turned back, px."""
    height, width = glimpses[0].image.shape[:2]
    slope = float(np.hypot(*plane.lens.parallax))
    if slope == 0.0:
        return np.zeros((height // TILE_SIDE_PX, width // TILE_SIDE_PX))
    grey = [replace(g, image=g.image.mean(axis=2, keepdims=True).astype(np.uint8)) for g in glimpses[::2]]
    swing = max(float(np.ptp([g.turn for g in glimpses])) / 2.0, 1e-3)
    tallest = _TALLEST * float(np.hypot(*(np.array([width, height]) / 2.0)))
    steps = int(np.clip(tallest * slope * swing / _HEIGHT_STEP_PX, 1, 10))
    heights = np.linspace(-tallest, tallest, 2 * steps + 1)
    restless = np.stack(
        [
            _by_tile(_stack(grey, plane, pivot_px, z, 2)[1][..., 0] ** 2, TILE_SIDE_PX // 2).mean(axis=(1, 3))
            for z in heights
        ]
    )
    # the vertex of the parabola through the steadiest height and its neighbours
    at = np.clip(restless.argmin(axis=0), 1, len(heights) - 2)
    before, here, after = (np.take_along_axis(restless, (at + k)[None], axis=0)[0] for k in (-1, 0, 1))
    bend = np.maximum(before - 2.0 * here + after, 1e-9)
    return heights[at] + np.clip(0.5 * (before - after) / bend, -1.0, 1.0) * (heights[1] - heights[0])


def _stack(
    glimpses: Sequence[FrameView], plane: MotionPlane, pivot_px: Floats, heights: float | Floats, step: int = 1
) -> tuple[Image, Image, NDArray[np.bool_]]:
    """Turn frames back as what stands at a height turns, or each pixel at its own; return middle, spread, what all saw.

    Of the pixels only each ``step``-th one along both axes is looked at.
    """
    height, width = glimpses[0].image.shape[:2]
    x, y = np.meshgrid(np.arange(0.0, width, step), np.arange(0.0, height, step))
    beside = np.reshape(heights, (-1, 1)) * plane.lens.parallax
    arms = np.stack([x, y], axis=-1).reshape(-1, 2) - pivot_px - beside
    pile, whole = [], np.ones(x.shape, bool)
    for g in glimpses:
        there = plane.lens.distort(arms @ rotation(g.turn) + g.pivot_px + beside)
        if g.turn_per_row:
            early = g.turn_per_row * (there[:, 1] - g.row)
            there = plane.lens.distort(_each_turned(arms, g.turn + early) + g.pivot_px + beside)
        at = there.reshape(*x.shape, 2).astype(np.float32)
        back = cv2.remap(g.image, at[..., 0], at[..., 1], cv2.INTER_LINEAR)
        pile.append(back.reshape(*x.shape, -1).astype(np.float32))
        whole &= (at >= 0).all(axis=2) & (at[..., 0] <= width - 1) & (at[..., 1] <= height - 1)
    return *_middle_and_spread(np.stack(pile)), whole


def _by_pixel(heights: Floats, shape: tuple[int, int]) -> float | Floats:
    """Give every pixel its tile's height."""
    if not heights.any():
        return 0.0
    rows, columns = (np.minimum(np.arange(n) // TILE_SIDE_PX, m - 1) for n, m in zip(shape, heights.shape, strict=True))
    return heights[np.ix_(rows, columns)]


def _middle_and_spread(pile: Image) -> tuple[Image, Image]:
    middle: Image = median_picture(pile)
    spread: Image = 1.4826 * median_picture(np.abs(pile - middle))
    return middle, spread


def _by_tile(part: Image, side: int = TILE_SIDE_PX) -> Image:
    rows, columns = part.shape[0] // side, part.shape[1] // side
    return part[: rows * side, : columns * side].reshape(rows, side, columns, side)


@njit(cache=True)
def _gather(image, ground, about, reach, here, turn, per_row, row, corner, side, pivot):  # type: ignore[no-untyped-def]
    top, bottom = max(0, int(about[1] - reach)), min(image.shape[0], int(about[1] + reach) + 2)
    left, right = max(0, int(about[0] - reach)), min(image.shape[1], int(about[0] + reach) + 2)
    room = max(0, bottom - top) * max(0, right - left)
    offsets, values, count = np.empty((room, 2)), np.empty((room, image.shape[2]), np.float32), 0
    c, s = np.cos(turn), np.sin(turn)
    for y in range(top, bottom):
        # a row that was exposed later shows the head turned further: its pixels are turned back about the pivot
        late = per_row * (y - row)
        cl, sl = np.cos(late), np.sin(late)
        for x in range(left, right):
            gx, gy = ground[y, x, 0] - here[0], ground[y, x, 1] - here[1]
            vx, vy = cl * gx - sl * gy, sl * gx + cl * gy
            at_x = pivot[0] + c * vx - s * vy - corner[0]
            at_y = pivot[1] + s * vx + c * vy - corner[1]
            if at_x < -0.5 or at_y < -0.5 or at_x > side + 0.5 or at_y > side + 0.5:
                continue
            offsets[count, 0], offsets[count, 1] = vx, vy
            for channel in range(image.shape[2]):
                values[count, channel] = image[y, x, channel]
            count += 1
    return offsets[:count], values[:count]
