"""The picture as a player shows it: upright, not mirrored, with square pixels.

A phone stores what its sensor reads and states how to turn it: the display matrix (ISO/IEC 14496-12, 8.3.2), which also
mirrors the picture of a front camera. Video formats store pixels that are wider or higher than square, and state their
aspect. All of anglecam sees the picture after both: `Film` applies them once.

Turning and mirroring move pixels and do not change them. Square pixels need resampling, along one axis: the shorter one
is stretched, as players do, so that no resolution is lost.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
from numpy.typing import ArrayLike

from anglecam.data.typing import Floats, Image
from anglecam.errors import InputError
from anglecam.video.container import LONGEST_SIDE, MOST_PIXELS

SQUARE = Fraction(1)
_NOT_STRAIGHT = 1e-3
"""Largest deviation of the matrix from a turn by a multiple of 90°: 0.06°. The matrix is stored in steps of 2⁻¹⁶."""


@dataclass(frozen=True)
class Display:
    """From the stored picture to the one that a player shows."""

    stored_size: tuple[int, int]
    """Width and height of the stored picture, px."""
    pixel_aspect: Fraction = SQUARE
    """Width of a stored pixel over its height."""
    transposed: bool = False
    """Whether rows become columns; mirroring comes after it."""
    mirrored: bool = False
    """Whether left and right change places."""
    upside_down: bool = False
    """Whether top and bottom change places."""

    @property
    def stretch(self) -> tuple[float, float]:
        """Factors of the stored picture's width and height, each at least 1."""
        aspect = float(self.pixel_aspect)
        return max(aspect, 1.0), max(1.0 / aspect, 1.0)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the shown picture, px."""
        width, height = (round(side * factor) for side, factor in zip(self.stored_size, self.stretch, strict=True))
        return (height, width) if self.transposed else (width, height)

    @cached_property
    def is_as_stored(self) -> bool:
        """Whether the shown picture is the stored one."""
        return self.pixel_aspect == SQUARE and not (self.transposed or self.mirrored or self.upside_down)

    def show(self, image: Image) -> Image:
        """Return the shown picture of a stored one.

        Parameters
        ----------
        image : ndarray
            (height, width, planes) bytes, as it is stored.

        Returns
        -------
        ndarray
            (height, width, planes) bytes.
        """
        if self.is_as_stored:
            return image
        planes = image.shape[2]
        if self.pixel_aspect != SQUARE:
            across, down = self.stretch
            image = cv2.resize(image, None, fx=across, fy=down, interpolation=cv2.INTER_LANCZOS4)
        if self.transposed:
            image = cv2.transpose(image)
        if self.mirrored or self.upside_down:
            image = cv2.flip(image, -1 if self.mirrored and self.upside_down else 1 if self.mirrored else 0)
        return image.reshape(*image.shape[:2], planes)  # OpenCV drops the axis of a single plane

    def square(self, points_px: ArrayLike) -> Floats:
        """Return points that were found in the upright picture of stored pixels at their positions in the shown one.

        Other programs turn a picture upright but do not make its pixels square.

        Parameters
        ----------
        points_px : array_like
            (…, 2) px.

        Returns
        -------
        ndarray
            (…, 2) px.
        """
        factors = np.array(self.stretch[::-1] if self.transposed else self.stretch)
        return (np.asarray(points_px, dtype=float) + 0.5) * factors - 0.5

    def shown_row_time(self, row_time_s: float) -> float | None:
        """Return the delay of the exposure from one row of the shown picture to the next.

        Parameters
        ----------
        row_time_s : float
            Delay from one row of the stored picture to the next, s: the sensor's rows.

        Returns
        -------
        float or None
            s, negative where the lowest row is exposed first; ``None`` where the sensor's rows are shown as columns.
        """
        if self.transposed:
            return None
        return (-row_time_s if self.upside_down else row_time_s) / self.stretch[1]


def read_display(path: Path, picture: av.VideoFrame, pixel_aspect: Fraction | None) -> Display:
    """Read how a player shows the pictures of a film.

    Parameters
    ----------
    path : Path
        The film, for messages.
    picture : VideoFrame
        A decoded picture of the film.
    pixel_aspect : Fraction or None
        As the container or the codec states it.

    Returns
    -------
    Display
        Of all pictures of the film.

    Raises
    ------
    InputError
        Where the display matrix turns by another angle than a multiple of 90°: players differ in what they show then.
        Also where square pixels would make the picture larger than `anglecam.video.container` allows.
    """
    size = (picture.width, picture.height)
    aspect = pixel_aspect or SQUARE
    matrix = _display_matrix(picture)
    # stored (p, q) is shown at (a·p + c·q, b·p + d·q); the matrix holds a, b, u, c, d, v, x, y, w
    turn = matrix.reshape(3, 3)[:2, :2].T
    lengths = np.hypot(*turn.T)[:, None]
    straight = np.round(turn / np.where(lengths > 0.0, lengths, 1.0))
    if (np.abs(straight).sum(axis=0) != 1).any() or (np.abs(turn - straight * lengths) > _NOT_STRAIGHT * lengths).any():
        raise InputError(
            f"{path}: it is to be shown turned by an angle that is no multiple of 90°; turn the film itself"
        )
    transposed = bool(straight[0, 0] == 0.0)
    display = Display(size, aspect, transposed, *(bool(axis < 0.0) for axis in straight.sum(axis=1)))
    width, height = display.size
    if max(width, height) > LONGEST_SIDE or width * height > MOST_PIXELS:
        raise InputError(f"{path}: its pixels of {aspect} make pictures of {width} × {height} px, which are not read")
    return display


def _display_matrix(picture: av.VideoFrame) -> Floats:
    """Return the picture's display matrix, (9,); the identity where it has none."""
    try:
        matrix: Any = picture.side_data.get("DISPLAYMATRIX")
    except ValueError:
        # PyAV cannot list the side data of a picture that has a kind unknown to it: EXIF, in JPEG. What it reads of
        # the orientation is the turn; an EXIF orientation that mirrors is not written by cameras.
        turn = np.radians(picture.rotation)
        return np.array([np.cos(turn), -np.sin(turn), 0.0, np.sin(turn), np.cos(turn), 0.0, 0.0, 0.0, 1.0])
    return np.eye(3).ravel() if matrix is None else np.frombuffer(bytes(matrix), np.int32, count=9).astype(float)
