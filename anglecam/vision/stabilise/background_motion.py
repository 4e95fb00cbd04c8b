"""How the camera moved in every frame, from scenery that stands still.

What a tile of the scenery looks like between its pixels is learnt from a few frames as a fine spline
(`anglecam.vision.stabilise.learn`): a camera that shakes puts its edges at a different place within the pixels in every
frame. Any other frame is followed roughly first (`anglecam.vision.stabilise.scenery`); then its shift and roll are those at which
tiles and frame fit best, by Gauss and Newton. The frame is never interpolated, so nothing locks to the pixels.

How much more the tiles disagree than their noise would make them, direction by direction, widens the uncertainty.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats, Image
from anglecam.vision.image.transforms import rotation
from anglecam.vision.registration.appearance import HIDDEN_MISFIT, TileAppearance, TileViews, compare_tiles
from anglecam.vision.stabilise.scenery import Scenery, scenery_motion
from anglecam.vision.stabilise.windows import WINDOW_SIDE_PX, displacements, follow_windows, subtract_local_mean

_STEPS = 4
"""Of Gauss and Newton, at most; from a few hundredths of a pixel one is nearly enough."""
_SETTLED_PX = 5e-3
_LEAST = 0.3
"""Of what the tiles tell in any direction, to be seen in a frame."""
_GAIN = 0.4
"""Most by which light changes."""
_SPOILT = 4.0
"""Times its usual mean square that all tiles may misfit in a frame."""
_COPY = 0.13
"""What a codec's copies hide of a motion, as a share of that whose change of the picture equals the tiles' misfit (see
`anglecam.vision.registration.turn`); all tiles alike, so that they cannot tell."""
TILE_MARGIN_PX = 2
"""About a tile, so that a rolled one is seen whole."""


@dataclass(frozen=True)
class CameraMove:
    """How one frame's picture is displaced from the reference's: p' = origin + shift + R(roll)·(p − origin)."""

    origin_px: Floats
    """(2,) in the reference, px."""
    shift_px: Floats
    """(2,) px; NaN where the scenery is hidden."""
    roll: float
    """Counter-clockwise as seen, rad; 0 where the camera only shifts."""
    covariance: Floats
    """(3, 3) of shift, px, and roll, rad."""

    @property
    def known(self) -> bool:
        """Whether enough of the scenery was seen."""
        return bool(np.isfinite(self.shift_px).all())

    def to_frame(self, points_px: Floats) -> Floats:
        """Carry points (…, 2) of the reference into the frame."""
        return np.asarray((points_px - self.origin_px) @ rotation(self.roll) + self.origin_px + self.shift_px)

    def to_reference(self, points_px: Floats) -> Floats:
        """Carry points (…, 2) of the frame into the reference."""
        return np.asarray((points_px - self.origin_px - self.shift_px) @ rotation(-self.roll) + self.origin_px)

    def place_covariance(self, point_px: Floats) -> Floats:
        """Give the covariance (2, 2) of where the frame shows a point (2,) of the reference, px²."""
        x, y = point_px - self.origin_px
        J = np.array([[1.0, 0.0, y], [0.0, 1.0, -x]])
        return np.asarray(J @ self.covariance @ J.T)


UNKNOWN_MOVE = CameraMove(np.zeros(2), np.full(2, np.nan), float("nan"), np.full((3, 3), np.nan))
"""Of a frame that shows nothing."""


@dataclass(frozen=True)
class BackgroundMotion:
    """The scenery as it was learnt; the reference is where the first of the frames learnt from has it."""

    picture: Image
    """(h, w) the first frame, levelled."""
    scenery: Scenery
    """Only its best tiles."""
    patches: TileAppearance
    """How they look."""
    variance: Floats
    """(tiles,) mean square of what each leaves over, grey levels squared."""
    rolls: bool
    """Whether the camera rolls more than can be chance."""
    unlike: Floats
    """(3, 3) ratio of the covariance of roll, x and y to what noise alone would make it, L: L·unlike·Lᵀ is the whole
    of what in noise would be L·Lᵀ; at least 1."""

    def at(self, image: Image, predicted: bool = False) -> CameraMove:
        """Find how a frame is displaced.

        Parameters
        ----------
        image : ndarray
            (h, w, 3) blue, green, red, or (h, w) brightness.
        predicted : bool
            Whether the codec made the frame from others.

        Returns
        -------
        CameraMove
            Unknown, its values NaN, where too little of the scenery is to be seen.
        """
        picture, origin = brightness(image), self.scenery.origin_px
        shift, roll = scenery_motion(
            self.scenery, follow_windows(self.picture, subtract_local_mean(picture), self.scenery.centres_px)
        )
        if not np.isfinite(roll):
            return _lost(origin)
        roll = roll if self.rolls else 0.0
        cuts = cut_tiles([picture], self.scenery, shift[None], np.array([roll]))
        rolls, origins = np.empty(len(self.patches)), np.broadcast_to(origin, (len(self.patches), 2))
        for _ in range(_STEPS):
            rolls[:] = roll
            views = as_views(cuts.pixels[0] - origin - shift, cuts.values[0])
            fit = compare_tiles(self.patches, views, rolls, origins)
            # the edge of something else may fit in shape, not in strength
            seen = cuts.whole[0] & (fit.count > 0) & (np.abs(fit.light[:, 0, 0]) < _GAIN)
            if not seen.any():
                return _lost(origin)
            misfit = fit.squares / np.maximum(fit.count, 1) / self.variance
            # motion blur spoils all tiles alike, a passer-by only some
            usual = float(np.clip(np.median(misfit[seen]), 1.0, _SPOILT))
            seen &= misfit < HIDDEN_MISFIT * usual
            normals, gradients = fit.weighted(self.variance * usual)
            normal = normals[seen].sum(axis=0)
            if np.linalg.eigvals(np.linalg.solve(normals.sum(axis=0)[1:, 1:], normal[1:, 1:])).min() < _LEAST:
                return _lost(origin)
            step, covariance = solve_motion(normal, gradients[seen].sum(axis=0), self.rolls)
            shift, roll = shift - step[1:] @ rotation(roll), roll + float(step[0])
            if np.abs(step[1:]).max() < _SETTLED_PX:
                break
        hidden = _COPY**2 * float(fit.count[seen].sum()) if predicted else 0.0
        lower = np.zeros((3, 3))
        free = free_parameters(self.rolls)
        lower[free, free] = np.linalg.cholesky(covariance[free, free])
        turn = np.eye(3)
        turn[1:, 1:] = rotation(roll)
        covariance = turn.T @ lower @ (self.unlike + hidden * np.eye(3)) @ lower.T @ turn
        last = [1, 2, 0]
        return CameraMove(origin, shift, roll, covariance[np.ix_(last, last)])


def _lost(origin: Floats) -> CameraMove:
    return CameraMove(origin, np.full(2, np.nan), float("nan"), np.full((3, 3), np.nan))


def brightness(image: Image) -> Image:
    """Weigh blue, green, red (h, w, 3) into grey (h, w): what codecs store at full resolution."""
    planes = 1 if image.ndim == 2 else image.shape[2]
    return image.reshape(image.shape[:2]) if planes == 1 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)


@dataclass(frozen=True)
class TileCuts:
    """What frames show of the tiles, and a little around them."""

    pixels: Floats
    """(frames, tiles, m, 2) px."""
    values: NDArray[np.float32]
    """(frames, tiles, m)."""
    whole: NDArray[np.bool_]
    """(frames, tiles) whether all of it is in the picture."""


def free_parameters(rolling: bool) -> slice:
    """Say which of roll, x and y are looked for."""
    return slice(0 if rolling else 1, 3)


def solve_motion(normal: Floats, gradient: Floats, rolling: bool) -> tuple[Floats, Floats]:
    """Solve for roll, x and y of the tiles' places, or for x and y alone.

    Parameters
    ----------
    normal, gradient : ndarray
        (3, 3) and (3,), over the variances.
    rolling : bool
        Whether the roll is looked for.

    Returns
    -------
    tuple of ndarray
        Step (3,), rad and px, and its covariance (3, 3); zero in what is not looked for.
    """
    free = free_parameters(rolling)
    step, covariance = np.zeros(3), np.zeros((3, 3))
    covariance[free, free] = np.linalg.inv(normal[free, free])
    step[free] = covariance[free, free] @ gradient[free]
    return step, covariance


def cut_tiles(pictures: Sequence[Image], scenery: Scenery, shifts: Floats, rolls: Floats) -> TileCuts:
    """Cut squares out of the frames, each by whole pixels about where its tile is.

    Parameters
    ----------
    pictures : sequence of ndarray
        (h, w) brightness.
    scenery : Scenery
        The tiles.
    shifts, rolls : ndarray
        (frames, 2) px and (frames,) rad, as far as they are known.
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
    """Put views (n, m, 2) and their values (n, m), all of equally many pixels, one after another."""
    count, each = values.shape
    return TileViews(offsets.reshape(-1, 2), values.reshape(-1, 1), np.arange(count + 1) * each)
