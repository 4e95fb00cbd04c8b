"""How the camera moved in every frame, from scenery that stands still.

What a tile of the scenery looks like between its pixels is learnt from a few frames as a fine spline
(`anglecam.vision.patch`): a camera that shakes puts its edges at a different place within the pixels in every frame.
Any other frame is followed roughly first (`anglecam.vision.scenery`); then its shift and roll are those at which
tiles and frame fit best, by Gauss and Newton. The frame is never interpolated, so nothing locks to the pixels.

How much more the tiles disagree than their noise would make them, direction by direction, widens the uncertainty.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from anglecam.vision.patch import Fit, Patches, Views, compare, learn_patch, levelled
from anglecam.vision.scenery import SIDE_PX, Image, Scenery, carried, find_scenery, follow, level, locate

Floats = NDArray[np.float64]

_TILES = 24
"""The most telling ones."""
_ROUNDS = 4
"""Of learning looks and motions in turn."""
_STEPS = 4
"""Of Gauss and Newton, at most; from a few hundredths of a pixel one is nearly enough."""
_SETTLED_PX = 1e-3
_HIDDEN = 3.0
"""Times its usual mean square that a tile misfits where something hides it."""
_HALF = 0.3
"""Of what the tiles tell in any direction, to be seen in a frame."""
_ROLLS = 9.0
"""Mean square of the rolls in the frames learnt from, in units of their variance, from which on the camera rolls."""
_MARGIN_PX = 2
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
        return np.asarray((points_px - self.origin_px) @ _turned(self.roll) + self.origin_px + self.shift_px)

    def to_reference(self, points_px: Floats) -> Floats:
        """Carry points (…, 2) of the frame into the reference."""
        return np.asarray((points_px - self.origin_px - self.shift_px) @ _turned(-self.roll) + self.origin_px)

    def place_covariance(self, point_px: Floats) -> Floats:
        """Give the covariance (2, 2) of where the frame shows a point (2,) of the reference, px²."""
        x, y = point_px - self.origin_px
        J = np.array([[1.0, 0.0, y], [0.0, 1.0, -x]])
        return np.asarray(J @ self.covariance @ J.T)


@dataclass(frozen=True)
class Steady:
    """The scenery as it was learnt; the reference is where the first of the frames learnt from has it."""

    picture: Image
    """(h, w) the first frame, levelled."""
    scenery: Scenery
    """Only its best tiles."""
    patches: Patches
    """How they look."""
    variance: Floats
    """(tiles,) mean square of what each leaves over, grey levels squared."""
    rolls: bool
    """Whether the camera rolls more than can be chance."""
    unlike: Floats
    """(3,) ratios of the standard uncertainties of roll, x and y to what noise alone would make them; at least 1."""

    def at(self, image: Image) -> CameraMove:
        """Find how a frame is displaced.

        Parameters
        ----------
        image : ndarray
            (h, w, 3) blue, green, red.

        Returns
        -------
        CameraMove
            Unknown, its values NaN, where too little of the scenery is to be seen.
        """
        picture, origin = brightness(image), self.scenery.origin_px
        shift, roll = locate(self.scenery, follow(self.picture, level(picture), self.scenery.centres_px))
        roll = roll if self.rolls else 0.0 * roll
        lost = CameraMove(origin, np.full(2, np.nan), float("nan"), np.full((3, 3), np.nan))
        for _ in range(_STEPS):
            if not np.isfinite(shift).all():
                return lost
            fit, seen = _look(self.patches, picture, origin, shift, roll)
            mean_square = fit.squares / np.maximum(fit.count, 1)
            seen &= fit.count > 0
            if not seen.any():
                return lost
            usual = max(1.0, float(np.median((mean_square / self.variance)[seen])))
            seen &= mean_square < _HIDDEN * usual * self.variance
            normal, gradient = fit.weighted(np.where(seen, self.variance * usual, np.inf))
            if not _enough(normal.sum(axis=0), fit.weighted(self.variance * usual)[0].sum(axis=0)):
                return lost
            step, covariance = _solve(normal.sum(axis=0), gradient.sum(axis=0), self.rolls)
            shift, roll = shift - step[1:] @ _turned(roll), roll + step[0]
            if np.abs(step[1:]).max() < _SETTLED_PX:
                break
        covariance = self.unlike[:, None] * covariance * self.unlike
        turn = np.eye(3)
        turn[1:, 1:] = _turned(roll)
        covariance = turn.T @ covariance @ turn
        return CameraMove(origin, shift, float(roll), covariance[np.ix_([1, 2, 0], [1, 2, 0])])


def shakes(images: Sequence[Image]) -> bool:
    """Tell from frames spread over a clip whether its camera shakes.

    Parameters
    ----------
    images : sequence of ndarray
        (h, w, 3) blue, green, red.

    Returns
    -------
    bool
        In doubt not.
    """
    scenery = find_scenery([brightness(image) for image in images])
    return scenery is not None and scenery.shakes


def learn_steady(images: Sequence[Image]) -> Steady | None:
    """Learn the scenery where the camera does not stand still.

    Parameters
    ----------
    images : sequence of ndarray
        (h, w, 3) blue, green, red, spread over a clip; some thirty.

    Returns
    -------
    Steady or None
        ``None`` where the camera stands still, or may do so.
    """
    pictures = [brightness(image) for image in images]
    scenery = find_scenery(pictures)
    if scenery is None or not scenery.shakes:
        return None
    known = np.flatnonzero(np.isfinite(scenery.rolls))
    best = np.argsort(-scenery.information)[:_TILES]
    shifts, rolls = scenery.shifts_px[known].copy(), scenery.rolls[known].copy()
    scenery = replace(
        scenery, centres_px=scenery.centres_px[best], metric=scenery.metric[best], information=scenery.information[best]
    )
    return _learn(level(pictures[0]), [pictures[k] for k in known], scenery, shifts, rolls)


def brightness(image: Image) -> Image:
    """Weigh blue, green, red (h, w, 3) into grey (h, w): what codecs store at full resolution."""
    return cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)


def _learn(first: Image, pictures: Sequence[Image], scenery: Scenery, shifts: Floats, rolls: Floats) -> Steady:
    origin = scenery.origin_px
    corners = scenery.centres_px - SIDE_PX / 2
    each = [_views(corners, picture, origin, s, r) for picture, s, r in zip(pictures, shifts, rolls, strict=True)]
    raise NotImplementedError


def _turned(roll: float) -> Floats:
    """Return the matrix M with which v @ M is v turned counter-clockwise as seen, y down."""
    c, s = np.cos(roll), np.sin(roll)
    return np.array([[c, -s], [s, c]])
