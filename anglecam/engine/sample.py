"""A few frames of a film as a camera at rest would see them under steady light, cut to where something changes.

Explanations of what moves are compared on such a sample (`anglecam.engine.score`). Its frames are grey and
reduced, so that memory and time do not grow with the film.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats, Image
from anglecam.engine.tint import tinted
from anglecam.engine.typical import median_and_variance

FRAMES = 48
"""Frames of a sample, at most."""
LONGEST_PX = 240
"""Longer side of the part that is kept, after the reduction."""
_CHANGE = 6.0
"""Standard deviations by which a smoothed pixel has to differ from its median to count as changed. Only what is cut off
depends on it; every pixel that is kept is compared. Of 10⁵ pixels in 48 frames none differs as much by chance."""
_LEFT_OUT = 0.01
"""Share of the change that may lie beyond each side of the part that is kept."""
_NEIGHBOURS, _MUCH = 0.03, 0.2
"""Changes within this share of the picture's side are one part of it if they reach this share of the greatest."""
_PARTS = 2
"""Parts that are looked at closer, at most."""
_CLOSER = 0.7
"""Largest share of the side of all that changes for which a part is worth a closer look."""
_MARGIN = 0.15
"""Of the longer side of what changes: the part of the surroundings that is kept."""
_LEAST_NOISE = 0.5
"""Grey levels; pixels are whole numbers."""
_LEAST_FRAMES = 8
"""Fewest frames from which a body and its background can be learnt, each half from the other."""
_LEAST_SIDE_PX = 8
_MAD, _AT_REST = 1.4826, 3.1383
"""Standard deviation of normal values over the median of their magnitudes, and over the lower quartile."""
_NOISIER = 3.0
"""Times the upper quartile of all frames that the noise of a frame may be."""
_DARK, _BRIGHT = 16.0, 235.0
"""Grey levels between which a pixel follows the light; black and white of television."""
_LIGHT_PIXELS, _LEAST_LIGHT_PIXELS = 2000, 50
"""By which the light of a frame is found, usually and at least."""
_LEAST_LIGHT = 0.005
"""Standard deviation of the logarithm of a pixel's brightness: half a grey level of a hundred."""
_TUKEY = 4.685
"""Standard deviations from which on a pixel has no weight (95 % efficient for normal errors)."""
_LIGHT_ROUNDS = 5
_PRIOR = 1.0
"""Weight, in pixels, of light that changes alike everywhere."""


@dataclass(frozen=True)
class Sample:
    """K frames of h × w pixels."""

    pictures: NDArray[np.float32] = field(repr=False)
    """(K, h, w) grey levels."""
    frames: NDArray[np.int64]
    """(K,) numbers of the frames in the film."""
    scale: float
    """Pixels of the sample for each pixel of the film."""
    corner_px: Floats
    """(2,) place of the sample's corner in the film, px."""
    noise: float
    """Standard deviation of a pixel where nothing moves, grey levels, the codec's errors included."""
    median: NDArray[np.float32] = field(repr=False)
    """(h, w) of the pictures; the light of other frames is compared with it."""
    tint: Floats | None = None
    """(3,) mixture of colours that the pictures show (`anglecam.engine.tint`); ``None``: their brightness."""

    def excess(self, picture: NDArray[np.float32]) -> float:
        """Return by how much the variance of a pixel at rest is larger in a frame than usual, grey levels²."""
        return max(0.0, min(self._deviation(picture), self._most_noise) ** 2 - self.noise**2)

    @cached_property
    def excesses(self) -> NDArray[np.float32]:
        """(K,) the same of its pictures."""
        return np.array([self.excess(picture) for picture in self.pictures], np.float32)

    def typical(self, use: NDArray[np.int64]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return (h, w) the median of pictures (m,), grey levels, and the robust variance about it."""
        key = use.tobytes()
        if key not in self._typical:
            self._typical[key] = median_and_variance(self.pictures[use])
        return self._typical[key]

    @cached_property
    def _typical(self) -> dict[bytes, tuple[NDArray[np.float32], NDArray[np.float32]]]:
        """By the pictures' numbers: explanations are learnt from the same halves."""
        return {}

    @cached_property
    def _most_noise(self) -> float:
        """Grey levels. What differs more is no noise: something else is before the camera."""
        return _NOISIER * float(np.quantile([self._deviation(picture) for picture in self.pictures], 0.75))

    def _deviation(self, picture: NDArray[np.float32]) -> float:
        """Return the standard deviation of pixels at rest about the median, grey levels."""
        off = np.abs(picture - self.median)
        known = off[np.isfinite(off)]
        return _AT_REST * float(np.quantile(known, 0.25)) if known.size else 0.0

    def place(self, point_px: Floats) -> Floats:
        """Map points (…, 2) of the film, px, to the sample."""
        return np.asarray((np.asarray(point_px) - self.corner_px + 0.5) * self.scale - 0.5)

    def seen(self, image: Image, move: Floats | None = None) -> NDArray[np.float32]:
        """Return another frame of the film as `pictures` shows those of the sample.

        Parameters
        ----------
        image : ndarray
            (height, width, 3) BGR or (height, width[, 1]) brightness.
        move : (2, 3) ndarray, optional
            The affine map from the picture of a camera at rest to the frame, px.
        """
        height, width = self.median.shape
        left, top = self.corner_px.astype(int)
        part = np.s_[top : top + round(height / self.scale), left : left + round(width / self.scale)]
        return in_light(_seen(image, move, self.scale, part, (width, height), self.tint), self.median)

    def in_film(self, place: Floats) -> Floats:
        """Map places (…, 2) of the sample to the film, px."""
        return np.asarray((np.asarray(place) + 0.5) / self.scale - 0.5 + self.corner_px)


@dataclass(frozen=True)
class Stills:
    """K frames spread over a film."""

    images: Sequence[Image] = field(repr=False)
    """(height, width, 3), BGR, or (height, width[, 1]) brightness."""
    moves: Sequence[Floats | None]
    """For each the (2, 3) affine map from the picture of a camera at rest to the frame, px; ``None`` for none."""
    frames: NDArray[np.int64]
    """(K,) their numbers in the film."""
    tint: Floats | None = None
    """(3,) mixture of colours by which they are seen; ``None``: by their brightness."""

    def seen(
        self, scale: float, part: tuple[slice, slice] = np.s_[:, :], size: tuple[int, int] | None = None
    ) -> NDArray[np.float32]:
        """Return (K, h, w) the same part of all frames, reduced, as a camera at rest sees it."""
        shown = zip(self.images, self.moves, strict=True)
        return np.stack([_seen(image, move, scale, part, size, self.tint) for image, move in shown])


def sample_stills(stills: Stills, held_px: Floats | None = None) -> list[Sample]:
    """Cut frames to where something changes, and reduce them.

    Parameters
    ----------
    stills : Stills
        Of the film.
    held_px : (4,) ndarray, optional
        Left, top, right, bottom of what every sample shows, px.

    Returns
    -------
    list of Sample
        Of all that changes, and closer ones of parts in which much changes, if they are small; empty where nothing
        changes.
    """
    height, width = stills.images[0].shape[:2]
    small = min(1.0, LONGEST_PX / max(width, height))
    whole = stills.seen(small)
    boxes = changed_boxes(steady_light(whole[_alike(whole)]))
    found = (sample_part(stills, box / small, held_px) for box in boxes)
    return [one for one in found if one is not None]


def sample_part(stills: Stills, box_px: Floats, held_px: Floats | None = None) -> Sample | None:
    """Cut frames to a part of the picture, and reduce them.

    Parameters
    ----------
    stills : Stills
        Of the film.
    box_px : (4,) ndarray
        Left, top, right, bottom, px.
    held_px : (4,) ndarray, optional
        The same of what it shows besides.

    Returns
    -------
    Sample or None
        Without frames that show another picture altogether, such as black ones; ``None`` if they are too few.
    """
    height, width = stills.images[0].shape[:2]
    if held_px is not None:
        box_px = np.concatenate([np.minimum(box_px[:2], held_px[:2]), np.maximum(box_px[2:], held_px[2:])])
    left, top, right, bottom = np.clip(np.round(box_px), 0, [width, height] * 2).astype(int).tolist()
    if min(right - left, bottom - top) < _LEAST_SIDE_PX:
        return None
    scale = min(1.0, LONGEST_PX / max(right - left, bottom - top))
    part = np.s_[top:bottom, left:right]
    pictures = stills.seen(scale, part)
    shown = _alike(pictures)
    if shown.sum() < _LEAST_FRAMES:
        return None
    seen = sample_of(pictures[shown], stills.frames[shown], scale, np.array([left, top]))
    return replace(seen, tint=stills.tint)


def _alike(pictures: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Return (K,) which pictures show at least half of what the median of all shows neither black nor saturated."""
    median = np.median(pictures, axis=0)
    fair = (median > _DARK) & (median < _BRIGHT)
    shown = (pictures[:, fair] > _DARK) & (pictures[:, fair] < _BRIGHT)
    return np.asarray(shown.mean(axis=1) > 0.5 if fair.any() else np.ones(len(pictures), bool))


def sample_of(pictures: NDArray[np.generic], frames: NDArray[np.int64], scale: float, corner_px: Floats) -> Sample:
    """Return the sample of (K, h, w) pictures; ``frames`` are their numbers."""
    steady = steady_light(np.asarray(pictures, np.float32))
    return Sample(steady, frames, scale, corner_px, noise_of(steady), np.median(steady, axis=0))


def steady_light(pictures: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return (K, h, w) pictures, each divided by its brightness relative to their median (`in_light`)."""
    median = np.median(pictures, axis=0)
    return np.stack([in_light(picture, median) for picture in pictures])


def in_light(picture: NDArray[np.float32], median: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return a picture divided by its brightness relative to a median picture.

    Light and exposure multiply the light that falls on a pixel, and so, by whatever power the camera applies, its grey
    level. The logarithm of the factor is a quadratic function of the place: light falls aslant, and lenses darken
    towards the corners. What moves has no weight (Tukey's biweight). A pixel that is saturated, or black, says that the
    light is as bright as it shows at least, or at most (Tobin, Econometrica 26, 1958).
    """
    fair = (median > _DARK) & (median < _BRIGHT) & np.isfinite(picture)
    limited = (picture >= _BRIGHT) | (picture <= _DARK)
    exact, bounds = (_thinned(fair & some) for some in (~limited, limited))
    height, width = picture.shape
    if len(exact) < _LEAST_LIGHT_PIXELS:
        return picture
    rows, columns = np.concatenate([exact, bounds]).T
    shown, known = picture[rows, columns], np.arange(len(rows)) < len(exact)
    terms = _quadratic(columns / width, rows / height)
    ratio = np.log(np.clip(shown, _DARK, _BRIGHT) / median[rows, columns])
    prior = np.diag([0.0, *np.full(terms.shape[1] - 1, _PRIOR)])
    factor = np.array([np.median(ratio[known]), *np.zeros(terms.shape[1] - 1)])
    for _ in range(_LIGHT_ROUNDS):
        off = ratio - terms @ factor
        says = known | np.where(shown >= _BRIGHT, off > 0.0, off < 0.0)
        scale = max(_LEAST_LIGHT, _MAD * float(np.median(np.abs(off[says]))))
        weight = np.where(says, np.maximum(0.0, 1.0 - (off / (_TUKEY * scale)) ** 2) ** 2, 0.0)
        weighted = terms.T * weight
        factor = np.linalg.solve(weighted @ terms + prior, weighted @ ratio)
    light = np.exp(_quadratic_of(height, width) @ factor).reshape(height, width)
    steady = picture / light
    # white is at least as bright as it shows, and black at least as dark
    steady = np.where(picture >= _BRIGHT, np.maximum(steady, median), steady)
    steady = np.where(picture <= _DARK, np.minimum(steady, median), steady)
    return np.asarray(steady, np.float32)


def _thinned(some: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return rows and columns (n, 2) of evenly drawn ones of some pixels."""
    return np.argwhere(some)[:: max(1, some.sum() // _LIGHT_PIXELS)]


def _quadratic(x: Floats, y: Floats) -> Floats:
    """Return (n, 6) functions of places, in widths and heights of the picture."""
    x, y = x - 0.5, y - 0.5
    return np.column_stack([np.ones_like(x), x, y, x * x, x * y, y * y])


@lru_cache(maxsize=4)
def _quadratic_of(height: int, width: int) -> Floats:
    """Return the functions of all pixels of a picture, row by row."""
    y, x = np.indices((height, width)).reshape(2, -1)
    return _quadratic(x / width, y / height)


def noise_of(pictures: NDArray[np.float32]) -> float:
    """Return the standard deviation of a pixel where nothing moves, grey levels.

    It is the lower quartile over the picture, as something may move in most of it, of the pixels that are known in all
    pictures.
    """
    deviation = np.median(np.abs(pictures - np.median(pictures, axis=0)), axis=0)
    known = deviation[np.isfinite(deviation)]
    return max(_LEAST_NOISE, _MAD * float(np.quantile(known, 0.25))) if known.size else _LEAST_NOISE


def _seen(
    image: Image,
    move: Floats | None,
    scale: float,
    part: tuple[slice, slice],
    size: tuple[int, int] | None,
    tint: Floats | None,
) -> NDArray[np.float32]:
    """Return a part of a frame as a camera at rest sees it, in one colour and reduced."""
    coloured = image.ndim == 3 and image.shape[2] == 3
    shown = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) if coloured and tint is None else image.squeeze()
    if move is not None:
        still = cv2.WARP_INVERSE_MAP | cv2.INTER_LINEAR
        shown = cv2.warpAffine(shown, move, shown.shape[1::-1], flags=still, borderMode=cv2.BORDER_REPLICATE)
    height, width = shown[part].shape[:2]
    size = size or (max(1, round(width * scale)), max(1, round(height * scale)))
    reduced = cv2.resize(shown[part], size, interpolation=cv2.INTER_AREA)
    return reduced.astype(np.float32) if tint is None else tinted(reduced, tint)


def changed_boxes(pictures: NDArray[np.float32]) -> list[Floats]:
    """Return left, top, right, bottom, px, of where most of the change is, and of smaller parts with much change."""
    noise = noise_of(pictures)
    off = np.abs(pictures - np.median(pictures, axis=0))
    smooth = np.stack([cv2.GaussianBlur(one, (0, 0), 1.0) for one in off])
    change = np.where(smooth > _CHANGE * noise, smooth**2, 0.0).mean(axis=0)
    if not change.any():
        return []
    whole = _box_of(change)
    spread = cv2.GaussianBlur(change, (0, 0), _NEIGHBOURS * max(change.shape))
    _, labels = cv2.connectedComponents((spread > _MUCH * spread.max()).astype(np.uint8))
    parts = [np.where(labels == k, change, 0.0) for k in range(1, labels.max() + 1)]
    boxes = [_box_of(part) for part in sorted(parts, key=lambda part: -float(part.sum())) if part.any()]
    side = _side(whole)
    return [whole, *[box for box in boxes if _side(box) < _CLOSER * side][:_PARTS]]


def _side(box: Floats) -> float:
    return float(max(box[2] - box[0], box[3] - box[1]))


def _box_of(change: NDArray[np.float64]) -> Floats:
    sides = []
    for axis in (0, 1):
        share = np.cumsum(change.sum(axis=axis)) / change.sum()
        sides.append((np.searchsorted(share, _LEFT_OUT), np.searchsorted(share, 1.0 - _LEFT_OUT) + 1))
    (left, right), (top, bottom) = sides
    height, width = change.shape
    margin = max(4.0, _MARGIN * float(max(right - left, bottom - top)))
    low = np.maximum([left - margin, top - margin], 0.0)
    return np.concatenate([low, np.minimum([right + margin, bottom + margin], [width, height])])
