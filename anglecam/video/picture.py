"""One picture of a film as a player shows it, converted when it is needed, and as far as it is needed.

Converting a picture to colours takes as long as decoding it. Whoever needs a small part of the colours, or the
brightness alone, does not wait for the rest.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import av
import numpy as np
from av.video.frame import PictureType
from numba import njit
from numpy.typing import NDArray

from anglecam.data.typing import Image
from anglecam.video.display import Display
from anglecam.video.fields import fill_rows, first_field

_PREDICTED = (PictureType.P, PictureType.B)
_REDUCTION = {
    "yuv420p": (2, 2),
    "yuvj420p": (2, 2),
    "yuv422p": (2, 1),
    "yuvj422p": (2, 1),
    "yuv444p": (1, 1),
    "yuvj444p": (1, 1),
}
"""Columns and rows of brightness for each one of colour, of the formats of which a part is converted."""
_ALIGNED_PX = 16
"""A part that is converted begins and ends at multiples of this, a margin away: there the conversion interpolates."""
_FULL, _BT_601 = 2, (2, 5, 6)
"""FFmpeg's numbers: JPEG's range of values; an unspecified matrix, and the two that are BT.601's."""


@dataclass(frozen=True, eq=False)
class Picture:
    """A frame of a film whose picture is converted on request."""

    index: int
    """0 for the first that is measured."""
    time: float
    """Presentation time, s, on the clip's clock."""
    stored: av.VideoFrame | None
    """As it was decoded; ``None`` where it cannot be decoded."""
    display: Display
    bottom_first: bool | None
    """Whether the second line of an interlaced picture belongs to its first field; ``None`` where all lines of a
    picture are of one instant."""

    @property
    def predicted(self) -> bool:
        """Whether the codec derived it from other frames."""
        return self.stored is not None and self.stored.pict_type in _PREDICTED

    @cached_property
    def colours(self) -> Image | None:
        """(height, width, 3) blue, green, red; ``None`` where it cannot be decoded."""
        return self._shown(to_colours)

    @cached_property
    def brightness(self) -> Image | None:
        """(height, width, 1) as the codec stored it; ``None`` where it cannot be decoded."""
        return self._shown(to_brightness)

    @property
    def has_parts(self) -> bool:
        """Whether a part of its colours can be converted without the rest."""
        return self.stored is not None and self._is_as_stored(self.stored)

    def colours_in(self, part: tuple[slice, slice]) -> Image:
        """Return the colours of a part of a picture that can be decoded, the same as those of the whole one.

        Parameters
        ----------
        part : tuple of slice
            Rows and columns, with a start and a stop inside the picture.

        Returns
        -------
        ndarray
            (rows, columns, 3) bytes: blue, green, red.
        """
        if "colours" not in self.__dict__ and self.has_parts:
            assert self.stored is not None
            return _colours_in(self.stored, part)
        assert self.colours is not None
        return self.colours[part]

    def colours_within(self, part: tuple[slice, slice]) -> Image | None:
        """Return a picture in which a part has its colours, and the rest may have any.

        Parameters
        ----------
        part : tuple of slice
            As in `colours_in`.

        Returns
        -------
        ndarray or None
            (height, width, 3) bytes: blue, green, red; ``None`` where the picture cannot be decoded.
        """
        stored = self.stored
        if stored is None or "colours" in self.__dict__ or not self.has_parts:
            return self.colours
        image = np.empty((stored.height, stored.width, 3), np.uint8)
        image[part] = _colours_in(stored, part)
        return image

    def is_same_as(self, other: Picture) -> bool:
        """Return whether two pictures are equal bit for bit, of which both can be decoded."""
        first, second = self.stored, other.stored
        if first is None or second is None:
            return False
        if not (self._is_as_stored(first) and other._is_as_stored(second) and first.format.name == second.format.name):
            return np.array_equal(self.colours, other.colours)  # type: ignore[arg-type]
        middle = first.height // 2  # noise makes pictures differ in nearly every row
        if not np.array_equal(_plane(first, 0)[middle], _plane(second, 0)[middle]):
            return False
        return all(np.array_equal(_plane(first, k), _plane(second, k)) for k in range(len(first.planes)))

    def _is_as_stored(self, stored: av.VideoFrame) -> bool:
        """Return whether each pixel of the picture is one of the stored picture, in a format that is known here."""
        field = self.bottom_first is not None and stored.interlaced_frame
        return stored.format.name in _REDUCTION and not field and self.display.is_as_stored

    def _shown(self, convert: Callable[[av.VideoFrame], Image]) -> Image | None:
        """Return the picture as a player shows it, of an interlaced one the first field."""
        stored = self.stored
        if stored is None:
            return None
        if self.bottom_first is None or not stored.interlaced_frame:
            return self.display.show(convert(stored))
        field = convert(first_field(stored, self.bottom_first))
        return self.display.show(fill_rows(field, self.display.stored_size[1], self.bottom_first))


def to_colours(picture: av.VideoFrame) -> Image:
    """Convert a picture to (height, width, 3) bytes: blue, green, red."""
    if _is_jpeg(picture):
        return _jpeg_part(picture, (slice(0, picture.height), slice(0, picture.width)))
    # starting threads takes longer than they save; lines that FFmpeg pads are packed, as the kernels expect
    return np.ascontiguousarray(picture.to_ndarray(format="bgr24", threads=1))


def to_brightness(picture: av.VideoFrame) -> Image:
    """Return a picture's brightness, (height, width, 1) bytes: the stored plane where there is one, else converted.

    Of samples of 9 to 16 bits the upper eight are returned.
    """
    bits = picture.format.components[0].bits
    if not picture.format.name.startswith(("yuv4", "yuvj4", "yuva4", "nv", "gray")) or not 8 <= bits <= 16:
        return np.ascontiguousarray(picture.to_ndarray(format="gray"))[..., None]
    if bits == 8:
        return _plane(picture, 0)[..., None].copy()
    plane = picture.planes[0]
    rows = np.frombuffer(memoryview(plane), np.uint8).reshape(plane.height, plane.line_size)
    samples = rows[:, : 2 * plane.width].view(">u2" if picture.format.is_big_endian else "<u2")
    return (samples >> (bits - 8)).astype(np.uint8)[..., None]


def _is_jpeg(picture: av.VideoFrame) -> bool:
    """Return whether JPEG's equations give a picture's colours, pixel by pixel.

    FFmpeg differs by one grey level in a hundredth of the pixels, in four times the time.
    """
    name, full = picture.format.name, picture.color_range == _FULL
    return (name == "yuvj444p" or (name == "yuv444p" and full)) and picture.colorspace in _BT_601


def _jpeg_part(picture: av.VideoFrame, part: tuple[slice, slice]) -> Image:
    rows, columns = part
    bright, of_blue, of_red = (_lines(picture, k) for k in range(3))
    return np.asarray(_jpeg_colours(bright, of_blue, of_red, rows.start, rows.stop, columns.start, columns.stop))


@njit("(uint8[:, ::1], uint8[:, ::1], uint8[:, ::1], int64, int64, int64, int64)", cache=True, nogil=True)
def _jpeg_colours(brightness, blueness, redness, top, bottom, left, right):  # type: ignore[no-untyped-def]
    """Convert a part of planes by JPEG's equations (ITU-T T.871), in integers of 14 binary places as OpenCV does."""
    width = right - left
    colours = np.empty((bottom - top, width, 3), np.uint8)
    blue, green, red = np.empty(width, np.uint8), np.empty(width, np.uint8), np.empty(width, np.uint8)
    for row in range(top, bottom):
        bright, of_blue, of_red = brightness[row, left:right], blueness[row, left:right], redness[row, left:right]
        for x in range(width):  # without the three interleaved: several pixels are converted at once
            y = np.int32(bright[x])
            u, v = np.int32(of_blue[x]) - 128, np.int32(of_red[x]) - 128
            blue[x] = min(max(y + ((29049 * u + 8192) >> 14), 0), 255)
            green[x] = min(max(y + ((-5636 * u - 11698 * v + 8192) >> 14), 0), 255)
            red[x] = min(max(y + ((22987 * v + 8192) >> 14), 0), 255)
        for x in range(width):
            colours[row - top, x, 0], colours[row - top, x, 1], colours[row - top, x, 2] = blue[x], green[x], red[x]
    return colours


def _plane(picture: av.VideoFrame, k: int) -> NDArray[np.uint8]:
    """Return one of the planes of a picture of 8 bits, (height, width)."""
    plane = picture.planes[k]
    return _lines(picture, k)[: plane.height, : plane.width]


def _lines(picture: av.VideoFrame, k: int) -> NDArray[np.uint8]:
    """Return such a plane as it lies in memory: its lines may be longer than the picture is wide."""
    plane = picture.planes[k]
    return np.frombuffer(memoryview(plane), np.uint8).reshape(-1, plane.line_size)


def _colours_in(picture: av.VideoFrame, part: tuple[slice, slice]) -> Image:
    """Convert a part of a picture in one of the formats of `_REDUCTION`."""
    if _is_jpeg(picture):
        return _jpeg_part(picture, part)
    rows, columns = part
    top, bottom = _aligned(rows, picture.height)
    left, right = _aligned(columns, picture.width)
    smaller = av.VideoFrame(right - left, bottom - top, picture.format.name)
    smaller.color_range, smaller.colorspace = picture.color_range, picture.colorspace
    for k, plane in enumerate(smaller.planes):
        across, down = _REDUCTION[picture.format.name] if k else (1, 1)
        padded = np.zeros((plane.buffer_size // plane.line_size, plane.line_size), np.uint8)
        stored = _plane(picture, k)[top // down :, left // across :][: plane.height, : plane.width]
        padded[: plane.height, : plane.width] = stored
        plane.update(padded.tobytes())
    return to_colours(smaller)[rows.start - top : rows.stop - top, columns.start - left : columns.stop - left]


def _aligned(part: slice, size: int) -> tuple[int, int]:
    """Return a wider range that begins and ends at aligned places, or where the picture ends."""
    start = max(part.start - _ALIGNED_PX, 0) // _ALIGNED_PX * _ALIGNED_PX
    return start, min(-(-(part.stop + _ALIGNED_PX) // _ALIGNED_PX) * _ALIGNED_PX, size)
