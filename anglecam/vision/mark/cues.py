"""Cues for the mark's colour: which colours a mark may have, and how strongly each pixel of a picture has one of them.

A declared colour is the only one, and so are the colours of a thing that somebody pointed at. Without either, two
kinds of colour compete: red as opposed to skin, as of lips in a face, and the colours that move, those of the pixels
that change during the clip. A black ball, a white stick, a grey hand and a green dot are found by the latter. So is the
wall that they uncover, which is no blob that travels on a circle.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.cluster.vq import kmeans2

from anglecam.data.typing import Floats, Image
from anglecam.vision.image.median import median_of_bytes
from anglecam.vision.mark.colour import hue_contrast, lab_of

_COLOURED = 20.0
"""Chroma, units of a*, b*, from which on a declared colour is recognised by its hue, which shading does not change. A
colour nearer to grey is recognised by its lightness too."""
_CLUSTERS = 6
"""Colours that move: a body, its mark, their shaded sides, and the background that they uncover."""
_ALIKE = 12.0
"""Lab units within which two clusters are one colour: shading of one surface."""
_RARE = 0.2
"""Share of the pixels around a box below which a colour belongs to the thing inside it."""
_POINT_PX = 2
"""Pixels around a point that is named that belong to the mark, too: a hand points no better."""
_SCALE, _OFFSET = np.array([100.0 / 255.0, 1.0, 1.0]), np.array([0.0, 128.0, 128.0], np.float32)
"""CIE Lab from the bytes in which OpenCV stores it."""
_CHANGES = 20.0
"""Grey levels by which a pixel changes that a body has passed, apart from flicker: several times a codec's error."""
_FEWEST_PIXELS = 40
"""Changing pixels in reduced pictures from which colours are learnt."""
_DRAWN = 20_000
"""Of their colours, drawn at random."""
_LONG_SIDE_PX = 480
"""The pictures are reduced to this for learning colours, which averages noise and a codec's chroma errors."""


@dataclass(frozen=True)
class Cue:
    """One colour that the mark may have."""

    name: str
    """``declared``, ``pointed``, ``red`` or ``moving``."""
    contrast: Callable[[Image], NDArray[Any]]
    """Maps a picture in CIE Lab (h, w, 3), bytes, to (h, w): larger is more like the colour, Lab units."""
    rgb: tuple[int, int, int] | None
    """The colour; ``None`` for red as opposed to skin, whatever its shade."""

    @property
    def on_body(self) -> bool:
        """Whether the mark is a part of a larger body that moves with it, as lips in a face."""
        return self.name in ("red", "declared")


RED = Cue("red", lambda lab: hue_contrast(lab, None), None)


def declared_cue(rgb: tuple[int, int, int]) -> Cue:
    """Return the cue of a declared colour, accurate to some tens of grey levels."""
    if np.hypot(*lab_of(rgb)[1:]) >= _COLOURED:
        return Cue("declared", lambda lab: hue_contrast(lab, rgb), rgb)
    return Cue("declared", lambda lab: closeness(lab, rgb), rgb)


def closeness(lab: Image, rgb: tuple[int, int, int]) -> NDArray[Any]:
    """Return how close each pixel's colour is to a given one: (h, w), minus the distance in CIE Lab.

    ``lab`` is a picture in CIE Lab (h, w, 3), as OpenCV stores it in bytes.
    """
    colour = (lab_of(rgb) / _SCALE + _OFFSET).astype(np.float32)
    found = np.empty(lab.shape[:2], np.float32)  # of NumPy, which asks for large pages of memory
    lightness, a, b = (np.ascontiguousarray(lab[..., k]) for k in range(3))
    _minus_distance(lightness, a, b, colour, _SCALE.astype(np.float32), found)
    return found


@njit(
    "(uint8[:, ::1], uint8[:, ::1], uint8[:, ::1], float32[::1], float32[::1], float32[:, ::1])", cache=True, nogil=True
)
def _minus_distance(lightness, a, b, colour, scale, found):  # type: ignore[no-untyped-def]
    for y in range(found.shape[0]):
        to, here, green_red, blue_yellow = found[y], lightness[y], a[y], b[y]
        for x in range(found.shape[1]):
            off_l = (np.float32(here[x]) - colour[0]) * scale[0]
            off_a = (np.float32(green_red[x]) - colour[1]) * scale[1]
            off_b = (np.float32(blue_yellow[x]) - colour[2]) * scale[2]
            to[x] = -np.sqrt(off_l * off_l + off_a * off_a + off_b * off_b)


def pointed_cues(image: Image, box_px: Floats) -> list[Cue]:
    """Return cues of the colours inside a box that are rare around it, the most frequent first.

    Parameters
    ----------
    image : ndarray
        (h, w, 3) the frame in which somebody pointed at the mark.
    box_px : ndarray
        (4,) left, top, right, bottom, px; a point is a box without extent.

    Returns
    -------
    list of Cue
        Empty where the box is outside the picture, or its surroundings have the same colours.
    """
    height, width = image.shape[:2]
    left, top = np.floor(box_px[:2]).astype(int) - _POINT_PX
    right, bottom = np.ceil(box_px[2:]).astype(int) + _POINT_PX + 1
    if left >= width or top >= height or right <= 0 or bottom <= 0:
        return []
    inside = np.zeros((height, width), bool)
    inside[max(top, 0) : bottom, max(left, 0) : right] = True
    lab = _lab(image)
    if np.hypot(right - left, bottom - top) < 4 * _POINT_PX:
        return [_of_colour("pointed", np.median(lab[inside], axis=0))]
    collar = cv2.dilate(inside.astype(np.uint8), np.ones((right - left, bottom - top), np.uint8).T) > inside
    centres = _colours_of(lab[inside])
    if not collar.any():
        return [_of_colour("pointed", centre) for centre in centres]
    rare = [c for c in centres if (np.linalg.norm(lab[collar] - c, axis=1) < _ALIKE).mean() < _RARE]
    return [_of_colour("pointed", centre) for centre in rare]


def moving_cues(images: Sequence[Image]) -> list[Cue]:
    """Return cues of the colours that move, the most frequent first.

    Parameters
    ----------
    images : sequence of ndarray
        (h, w, 3) frames spread over a clip, stabilised where the camera moves.

    Returns
    -------
    list of Cue
        Empty where nothing moves.
    """
    scale = min(1.0, _LONG_SIDE_PX / max(images[0].shape[:2]))
    small = np.stack([cv2.resize(i, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA) for i in images])
    level = np.array([[median_of_bytes(i[..., k]) for k in range(3)] for i in small], np.float32) + np.float32(1.0)
    gain = level.mean(axis=0) / level  # flicker of the light changes every pixel
    changing = _change(small, gain) > _CHANGES
    if changing.sum() < _FEWEST_PIXELS:
        return []
    colours = _lab(small[:, changing])
    rng = np.random.default_rng(0)
    return [
        _of_colour("moving", centre)
        for centre in _colours_of(colours.reshape(-1, 3)[rng.permutation(colours.shape[0] * colours.shape[1])[:_DRAWN]])
    ]


@njit("(uint8[:, :, :, ::1], float32[:, ::1])", cache=True, nogil=True)
def _change(images, gain):  # type: ignore[no-untyped-def]
    """Return by how much each pixel of images (n, h, w, 3) changes, where a gain (n, 3) evens out their light."""
    count, height, width, planes = images.shape
    change = np.zeros((height, width), np.float32)
    for y in range(height):
        for x in range(width):
            for k in range(planes):
                low = high = np.float32(images[0, y, x, k]) * gain[0, k]
                for t in range(1, count):
                    value = np.float32(images[t, y, x, k]) * gain[t, k]
                    low, high = min(value, low), max(value, high)
                change[y, x] = max(change[y, x], high - low)
    return change


def _colours_of(lab: Floats) -> list[Floats]:
    """Return the distinct colours among pixels (n, 3) of CIE Lab, the most frequent first."""
    centres, member = kmeans2(lab, min(_CLUSTERS, len(lab)), minit="++", seed=0)
    count = np.bincount(member, minlength=len(centres))
    kept: list[Floats] = []
    for k in np.argsort(-count):
        if count[k] and all(np.linalg.norm(centres[k] - other) > _ALIKE for other in kept):
            kept.append(centres[k])
    return kept


def _lab(image: Image) -> Floats:
    """Return an image in CIE Lab, (…, 3)."""
    return np.asarray((cv2.cvtColor(image, cv2.COLOR_BGR2LAB) - _OFFSET) * _SCALE, dtype=float)


def _of_colour(name: str, lab: Floats) -> Cue:
    """Return the cue of one colour of CIE Lab, (3,)."""
    stored = np.clip(np.round(lab / _SCALE + _OFFSET), 0, 255).astype(np.uint8)
    blue, green, red = cv2.cvtColor(stored.reshape(1, 1, 3), cv2.COLOR_LAB2BGR)[0, 0]
    rgb = int(red), int(green), int(blue)
    return Cue(name, lambda lab: closeness(lab, rgb), rgb)
