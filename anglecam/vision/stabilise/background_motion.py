"""The camera's motion in every frame, from scenery that does not move.

The appearance of the scenery's tiles is learnt from a few frames as a spline at sub-pixel resolution
(`anglecam.vision.stabilise.learn`): a shaking camera shows their edges at a different position within the pixels in
every frame. Any other frame's motion is first estimated roughly (`anglecam.vision.stabilise.scenery`). Its shift and
roll are then those at which tiles and frame fit best, found by Gauss-Newton steps. The frame is never interpolated, so
the result is not biased towards whole pixels.

The uncertainty is enlarged, direction by direction, by the ratio of the tiles' disagreement to that expected from their
noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anglecam.data.typing import Floats, Image
from anglecam.vision.image.transforms import rotation
from anglecam.vision.registration.appearance import HIDDEN_MISFIT, TileAppearance, compare_tiles
from anglecam.vision.stabilise.scenery import Scenery, scenery_motion
from anglecam.vision.stabilise.tile_cuts import as_views, brightness, cut_tiles
from anglecam.vision.stabilise.windows import TOLERANCE_PX, follow_windows, subtract_local_mean

_MAX_STEPS = 4
"""Gauss-Newton steps; from an error of a few hundredths of a pixel one step is nearly enough."""
_SETTLED_PX = 5e-3
"""Step below which the iteration ends, px."""
_MIN_SEEN = 0.3
"""Least share of the tiles that a frame must show."""
_MAX_LIGHT_CHANGE = 0.4
"""Largest relative change of contrast that light causes."""
_MAX_MISFIT = 4.0
"""Largest mean square misfit of all tiles of a frame, relative to their usual one, that is ascribed to the frame."""
_COPY = 0.13
"""Standard uncertainty caused by a codec's copies, as a share of the motion whose change of the picture equals the
tiles' misfit (see `anglecam.vision.registration.turn`). All tiles share it, so their scatter does not show it."""


@dataclass(frozen=True)
class CameraMove:
    """Displacement of one frame's picture from the reference: p' = origin + shift + R(roll)·(p − origin)."""

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
        """Whether enough of the scenery was visible."""
        return bool(np.isfinite(self.shift_px).all())

    def to_frame(self, points_px: Floats) -> Floats:
        """Map points (…, 2) of the reference to the frame."""
        return np.asarray((points_px - self.origin_px) @ rotation(self.roll) + self.origin_px + self.shift_px)

    def to_reference(self, points_px: Floats) -> Floats:
        """Map points (…, 2) of the frame to the reference."""
        return np.asarray((points_px - self.origin_px - self.shift_px) @ rotation(-self.roll) + self.origin_px)

    def place_covariance(self, point_px: Floats) -> Floats:
        """Return the covariance (2, 2) of the place in the frame of a point (2,) of the reference, px²."""
        x, y = point_px - self.origin_px
        J = np.array([[1.0, 0.0, y], [0.0, 1.0, -x]])
        return np.asarray(J @ self.covariance @ J.T)


UNKNOWN_MOVE = CameraMove(np.zeros(2), np.full(2, np.nan), float("nan"), np.full((3, 3), np.nan))
"""For a frame that shows nothing."""


@dataclass(frozen=True)
class BackgroundMotion:
    """The learnt scenery. The reference is its place in the first of the frames from which it was learnt."""

    picture: Image
    """(h, w) the first frame, local mean subtracted."""
    scenery: Scenery
    """With the best tiles only."""
    tiles: TileAppearance
    variance: Floats
    """(tiles,) mean squared residual of each tile, grey levels squared."""
    rolls: bool
    """Whether the camera rolls significantly."""
    covariance_ratio: Floats
    """(3, 3) ratio C of the covariance of roll, x and y to that expected from noise alone. If noise alone gives
    L·Lᵀ, the covariance is L·C·Lᵀ. Its eigenvalues are at least 1."""

    def at(self, image: Image, predicted: bool = False) -> CameraMove:
        """Measure the displacement of a frame.

        Parameters
        ----------
        image : ndarray
            (h, w, 3) blue, green, red, or (h, w) brightness.
        predicted : bool
            Whether the codec predicted the frame from others.

        Returns
        -------
        CameraMove
            Unknown, with NaN values, where too little of the scenery is visible.
        """
        picture, origin = brightness(image), self.scenery.origin_px
        moved = follow_windows(self.picture, subtract_local_mean(picture), self.scenery.centres_px)
        shift, roll = scenery_motion(self.scenery, moved)
        if not np.isfinite(roll):
            return _unknown(origin)
        roll = roll if self.rolls else 0.0
        cuts = cut_tiles([picture], self.scenery, shift[None], np.array([roll]))
        rolls, origins = np.empty(len(self.tiles)), np.broadcast_to(origin, (len(self.tiles), 2))
        for _ in range(_MAX_STEPS):
            rolls[:] = roll
            views = as_views(cuts.pixels[0] - origin - shift, cuts.values[0])
            fit = compare_tiles(self.tiles, views, rolls, origins).rigid()
            # Another object's edge may fit in shape, but not in contrast.
            seen = cuts.whole[0] & (fit.count > 0) & (np.abs(fit.light[:, 0, 0]) < _MAX_LIGHT_CHANGE)
            if not seen.any():
                return _unknown(origin)
            misfit = fit.squares / np.maximum(fit.count, 1) / self.variance
            # Motion blur affects all tiles alike, a passer-by only some.
            usual = float(np.clip(np.median(misfit[seen]), 1.0, _MAX_MISFIT))
            seen &= misfit < HIDDEN_MISFIT * usual
            normals, gradients = fit.weighted(self.variance * usual)
            normal = normals[seen].sum(axis=0)
            if seen.mean() < _MIN_SEEN or np.linalg.eigvalsh(normal[1:, 1:])[0] < 1.0 / TOLERANCE_PX**2:
                return _unknown(origin)
            step, covariance = solve_motion(normal, gradients[seen].sum(axis=0), self.rolls)
            shift, roll = shift - step[1:] @ rotation(roll), roll + float(step[0])
            if np.abs(step[1:]).max() < _SETTLED_PX:
                break
        copied = _COPY**2 * float(fit.count[seen].sum()) if predicted else 0.0
        lower = np.zeros((3, 3))
        free = free_parameters(self.rolls)
        lower[free, free] = np.linalg.cholesky(covariance[free, free])
        turn = np.eye(3)
        turn[1:, 1:] = rotation(roll)
        covariance = turn.T @ lower @ (self.covariance_ratio + copied * np.eye(3)) @ lower.T @ turn
        roll_last = [1, 2, 0]
        return CameraMove(origin, shift, roll, covariance[np.ix_(roll_last, roll_last)])


def _unknown(origin: Floats) -> CameraMove:
    return CameraMove(origin, np.full(2, np.nan), float("nan"), np.full((3, 3), np.nan))


def free_parameters(rolling: bool) -> slice:
    """Return which of roll, x and y are estimated."""
    return slice(0 if rolling else 1, 3)


def solve_motion(normal: Floats, gradient: Floats, rolling: bool) -> tuple[Floats, Floats]:
    """Solve the normal equations for roll, x and y of the tiles' places, or for x and y alone.

    Parameters
    ----------
    normal, gradient : ndarray
        (3, 3) and (3,), divided by the variances.
    rolling : bool
        Whether the roll is estimated.

    Returns
    -------
    tuple of ndarray
        Step (3,), rad and px, and its covariance (3, 3); zero for a parameter that is not estimated.
    """
    free = free_parameters(rolling)
    step, covariance = np.zeros(3), np.zeros((3, 3))
    covariance[free, free] = np.linalg.inv(normal[free, free])
    step[free] = covariance[free, free] @ gradient[free]
    return step, covariance
