"""The views of tiles of the body in frames.

All places are in the plane of motion (`anglecam.camera.lens`), in which the body rotates without changing its shape. A
point of the body that is z nearer to the camera than the pivot rotates around a different centre, where the axis of
rotation is seen at the height z: displaced from the pivot by z·parallax. Each tile therefore has a height.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit

from anglecam.camera.lens import Lens
from anglecam.data.typing import Floats, Image
from anglecam.threads import map_in_threads
from anglecam.vision.image.transforms import rotate_each, rotation
from anglecam.vision.registration.appearance import TileViews
from anglecam.vision.registration.axis_view import AxisView

TILE_SIDE_PX = 16
"""Side of a tile, px."""


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


def collect_tiles(
    corners: Floats, heights: Floats, frames: Sequence[FrameView], plane: MotionPlane, pivot_px: Floats
) -> list[TileViews]:
    """Collect the pixels of each tile from all frames.

    Parameters
    ----------
    corners, heights, frames, plane, pivot_px
        As in `view_tiles`.

    Returns
    -------
    list of TileViews
        One for each tile, with a view of every frame.
    """
    of_frames = map_in_threads(lambda f: view_tiles(corners, heights, [f], plane, pivot_px)[0], frames)

    def of_tile(t: int) -> TileViews:
        parts = [slice(v.starts[t], v.starts[t + 1]) for v in of_frames]
        return TileViews(
            np.concatenate([v.offsets[part] for v, part in zip(of_frames, parts, strict=True)]),
            np.concatenate([v.values[part] for v, part in zip(of_frames, parts, strict=True)]),
            np.append(0, np.cumsum([part.stop - part.start for part in parts])),
        )

    return [of_tile(t) for t in range(len(corners))]


@njit(
    "(uint8[:, :, ::1], float64[:, :, ::1], float64[:, ::1], float64, float64[:, ::1], float64, float64, "
    "float64, float64[:, ::1], int64, float64[:, ::1])",
    cache=True,
    nogil=True,
)
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
