"""How well a motion of the camera predicts the edges of a picture.

A picture is compared with the first one at the pixels of its edges: the logarithm of their density is summed, where
each pixel either shows what the motion predicts or anything at all. So motions of any kind are compared in one
currency.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np

from anglecam.data.typing import Flags, Floats, Image
from anglecam.vision.image.noise import pixel_noise
from anglecam.vision.image.reduction import reduced, reduction
from anglecam.vision.stabilise.tile_cuts import brightness
from anglecam.vision.stabilise.windows import subtract_local_mean

_LONGEST_PX = 640.0
"""Longer side to which pictures are reduced; a codec's noise is all that a telephone's pictures show beyond it."""
LEVELS = (8, 4, 2, 1)
"""Reductions of the pyramid, the coarsest first."""
_MOST_PIXELS = 6000
_LEAST_PIXELS = 50
"""Fewest edge pixels in which a motion can be seen."""
_LEAST_SLOPE = 1.0
"""Grey levels a pixel. Steps of rounding in a smooth wall have half of it."""
_SMOOTH_PX, _LOCAL_PX = 0.8, 8.0
"""Standard deviations of the blur that hides the pixel's grid, and of the surroundings whose mean is subtracted: light
that changes smoothly does not count."""
_EDGE_PX = 0.12
"""By which light, a codec and interpolation shift an edge, px of the reduced picture."""
_FOLLOWS, _ANY = 0.9, 0.1 / 100.0
"""Prior that a pixel shows what is predicted, and the density of anything else, 1/grey level."""
_BODY = 0.2
"""Radius of a body that slides, as a share of the picture's longer side, at most."""
_HALF = 0.5
"""Share of what they would gain if a motion were right that pixels of the scenery gain at least."""
_SIGNIFICANT = 3.0
"""Standard errors by which a motion has to predict the edges better than another (one in 700 by chance)."""


def is_better(gain: Floats) -> bool:
    """Return whether a motion of the camera predicts pictures significantly better, by its gain (pictures, n)."""
    each = gain.sum(axis=1)
    return len(each) > 1 and float(each.mean()) > _SIGNIFICANT * float(each.std()) / len(each) ** 0.5


@dataclass(frozen=True, eq=False)
class Level:
    """The edge pixels of one reduction of the first picture."""

    reduction: int
    places: Floats = field(repr=False)
    """(n, 2) px of the picture that is not reduced further, from its middle."""
    values: Floats = field(repr=False)
    """(n,) grey levels."""
    slopes: Floats = field(repr=False)
    """(n, 2) grey levels per px of the picture that is not reduced further."""
    sigma: Floats = field(repr=False)
    """(n,) standard deviation of a value that is predicted, grey levels."""


@dataclass(frozen=True, eq=False)
class SceneryEdges:
    """The edges of the first of some pictures."""

    size: tuple[int, int]
    """Width and height of the reduced picture, px."""
    to_reduced: Floats = field(repr=False)
    """(3, 3) from the film to it."""
    levels: tuple[Level, ...] = field(repr=False)
    """The coarsest first."""
    first: Image = field(repr=False)
    """The first picture as the finest level sees it."""

    def evidence(self, image: Image, move: Floats) -> Floats:
        """Return the log-likelihood (n,) of a frame's edge pixels where the camera has moved.

        Parameters
        ----------
        image : ndarray
            (h, w, 3) blue, green, red, or (h, w, 1) brightness.
        move : (3, 3) ndarray
            Homography from the first frame into this one, px.
        """
        level = self.levels[-1]
        off = values_at(levelled(self._reduced(image), 1), self._moved(move), self.size) - level.values
        return _evidence((off / level.sigma) ** 2, level.sigma)

    def _moved(self, move: Floats) -> Floats:
        """Return the places (n, 2) of the edge pixels after a motion of the camera."""
        small = self.to_reduced @ move @ np.linalg.inv(self.to_reduced)
        middle = np.array(self.size) / 2.0
        return np.asarray(cv2.perspectiveTransform((self.levels[-1].places + middle)[:, None], small)[:, 0] - middle)

    def pyramid(self, image: Image) -> list[Image]:
        """Return a frame at all levels."""
        picture = self._reduced(image)
        return [levelled(picture, k) for k in LEVELS]

    def gain(self, images: Sequence[Image], moves: Sequence[Floats | None], others: Sequence[Floats]) -> Floats:
        """Return by how much motions of the camera predict the edges of pictures better than others do.

        Parameters
        ----------
        images : sequence of ndarray
            (h, w, 3), the first one first.
        moves, others : sequence of ndarray
            (3, 3) homographies from the first picture into each, px. Pictures whose move is ``None`` do not count.

        Returns
        -------
        ndarray
            (pictures, n) nats, without the first picture.
        """
        rest = list(zip(images, moves, others, strict=True))[1:]
        gains = [self.evidence(k, one) - self.evidence(k, other) for k, one, other in rest if one is not None]
        return np.array(gains).reshape(-1, len(self.levels[-1].values))

    def gain_if_right(self, moves: Sequence[Floats], others: Sequence[Floats]) -> Floats:
        """Return what `gain` would be on average, (pictures, n) nats, if the pictures showed what the moves predict."""
        level = self.levels[-1]
        gains = []
        for one, other in list(zip(moves, others, strict=True))[1:]:
            off = values_at(self.first, self._moved(np.linalg.inv(one) @ other), self.size) - level.values
            as_other = _evidence(1.0 + (off / level.sigma) ** 2, level.sigma)
            gains.append(np.where(np.isfinite(off), _evidence(np.ones(len(off)), level.sigma) - as_other, 0.0))
        return np.array(gains)

    def is_scenery(self, gain: Floats, if_right: Floats) -> bool:
        """Return whether a motion of the camera predicts the edges better, and scenery in more than one place.

        A body that slides before a plain wall may have all edges that shift; a camera moves the rest of the picture,
        too. So the edges outside the disc that gains most have to gain. What swings follows a shift in some pictures,
        scenery in all: edges that gain half of what they would if the motion were right in one half of the pictures
        have to in the other half.

        Parameters
        ----------
        gain, if_right : ndarray
            (pictures, n) nats, from `gain` and `gain_if_right`.
        """
        halves = slice(0, None, 2), slice(1, None, 2)
        over = [(gain - _HALF * if_right)[half] for half in halves]
        held_out = []
        for k in (0, 1):
            follows = over[1 - k].sum(axis=0) > 0.0
            beyond = self._beyond_the_most(np.where(follows, gain[halves[1 - k]].sum(axis=0), 0.0))
            held_out.append(over[k][:, follows & beyond].sum(axis=1))
        elsewhere = gain[:, self._beyond_the_most(gain.sum(axis=0))]
        return is_better(gain) and is_better(elsewhere) and is_better(np.concatenate(held_out)[:, None])

    def _beyond_the_most(self, total: Floats) -> Flags:
        """Return which edge pixels (n,) lie outside the disc of a body's size that gains most."""
        places, radius = self.levels[-1].places, _BODY * max(self.size)
        near = [np.hypot(*(places - middle).T) < radius for middle in np.unique(places // radius, axis=0) * radius]
        return ~max(near, key=lambda one: float(total[one].sum()))

    def _reduced(self, image: Image) -> Image:
        return reduced(brightness(image), _LONGEST_PX)


def scenery_edges(images: Sequence[Image]) -> SceneryEdges | None:
    """Find the edges of the first picture.

    Parameters
    ----------
    images : sequence of ndarray
        (h, w, 3) blue, green, red, or (h, w, 1) brightness; the noise of their pixels is that between them.

    Returns
    -------
    SceneryEdges or None
        ``None`` where the picture shows too few.
    """
    picture = reduced(brightness(images[0]), _LONGEST_PX)
    noise = pixel_noise([subtract_local_mean(brightness(image)) for image in images])
    size = picture.shape[1], picture.shape[0]
    levels = tuple(_level(picture, k, noise) for k in LEVELS)
    if min(len(level.values) for level in levels) < _LEAST_PIXELS:
        return None
    return SceneryEdges(size, reduction(images[0].shape[:2], _LONGEST_PX), levels, levelled(picture, 1))


def _evidence(square: Floats, sigma: Floats) -> Floats:
    """Return the log density of pixels by their squared standardised departure from what is predicted, or NaN."""
    follows = np.exp(-0.5 * square) / (np.sqrt(2.0 * np.pi) * sigma)
    return np.asarray(np.log(_FOLLOWS * np.where(np.isfinite(square), follows, 0.0) + _ANY))


def _level(picture: Image, k: int, noise: float) -> Level:
    values = levelled(picture, k)
    gx, gy = (cv2.Scharr(values, cv2.CV_32F, *axis, scale=1 / 32) for axis in ((1, 0), (0, 1)))
    slope = np.hypot(gx, gy)
    slope[:2] = slope[-2:] = slope[:, :2] = slope[:, -2:] = 0.0
    least = float(np.sort(slope, axis=None)[-min(_MOST_PIXELS, slope.size)])
    row, column = np.nonzero(slope >= max(least, noise / k, _LEAST_SLOPE / np.sqrt(k)))
    per_px = values.shape[1] / picture.shape[1]
    places = (
        (np.column_stack([column, row]) + 0.5) / per_px - 0.5 - np.array([picture.shape[1], picture.shape[0]]) / 2.0
    )
    sigma = np.sqrt((1.5 * noise / k) ** 2 + 1.0 + (_EDGE_PX * slope[row, column]) ** 2)
    slopes = np.column_stack([gx[row, column], gy[row, column]]) * per_px
    return Level(k, places, values[row, column].astype(float), slopes.astype(float), sigma)


def levelled(picture: Image, k: int) -> Image:
    """Return a reduced picture, smoothed, relative to its local mean."""
    size = max(8, round(picture.shape[1] / k)), max(8, round(picture.shape[0] / k))
    small = cv2.resize(picture.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    smooth = cv2.GaussianBlur(small, (0, 0), _SMOOTH_PX)
    return np.asarray(smooth - cv2.GaussianBlur(smooth, (0, 0), _LOCAL_PX))


def values_at(picture: Image, places: Floats, size: tuple[int, int]) -> Floats:
    """Return a levelled picture's values (n,) at places from its middle; NaN beyond its edges."""
    per_px = np.array([picture.shape[1] / size[0], picture.shape[0] / size[1]])
    at = ((places + np.array(size) / 2.0 + 0.5) * per_px - 0.5).astype(np.float32)
    x, y = np.ascontiguousarray(at[:, 0])[None], np.ascontiguousarray(at[:, 1])[None]
    seen = cv2.remap(picture, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=[float("nan")])
    return np.asarray(seen[0], np.float64)
