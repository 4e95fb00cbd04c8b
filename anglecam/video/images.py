"""Decode the numbered pictures of a folder as a film: a time and a picture for each number."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import av

from anglecam.errors import InputError
from anglecam.video.container import MOST_FRAMES, MOST_PIXELS
from anglecam.video.decode import OneSize, Row, Wants

_CODECS = {".png": "png", ".jpg": "mjpeg", ".jpeg": "mjpeg", ".tif": "tiff", ".tiff": "tiff", ".bmp": "bmp"}
_MOST_BYTES = 8 * MOST_PIXELS
"""Of one file: the largest picture that is read, with four planes of 16 bits."""


def decode_images(
    folder: Path, images: Mapping[int, Path], rate_hz: float, wants: Wants | None = None
) -> Iterator[Row]:
    """Yield the pictures of a folder in the order of their numbers.

    Parameters
    ----------
    folder : Path
        Their folder.
    images : mapping of int to Path
        From `anglecam.io.numbered_images.find_numbered_images`.
    rate_hz : float
        Pictures per second. The first one is at 0 s.
    wants : callable, optional
        Which rows' pictures are wanted; the other rows have none.

    Yields
    ------
    tuple of (float, VideoFrame or None)
        Time, s, and picture; ``None`` where a number is missing or its file cannot be decoded.

    Raises
    ------
    InputError
        Where pictures change their size or no picture can be decoded.
    """
    first, last = min(images), max(images)
    if last - first >= MOST_FRAMES:
        raise InputError(f"{folder}: more than {MOST_FRAMES:,} frames are not read")
    one_size: OneSize | None = None
    for number in range(first, last + 1):
        time = (number - first) / rate_hz
        wanted = number in images and (wants is None or wants(number - first))
        picture = _decode_image(images[number]) if wanted else None
        if picture is not None:
            one_size = one_size or OneSize(folder, (picture.width, picture.height))
            picture = picture if one_size.allows(picture, time) else None
        yield time, picture
    if one_size is None and wants is None:
        raise InputError(f"{folder}: none of its {len(images)} pictures can be decoded")


def _decode_image(path: Path) -> av.VideoFrame | None:
    """Return the picture of a file, ``None`` where it cannot be decoded."""
    # a decoder of its own reads one picture and nothing else: a file cannot refer to others
    decoder = av.CodecContext.create(_CODECS[path.suffix.lower()], "r")
    assert isinstance(decoder, av.VideoCodecContext)
    decoder.options = {"max_pixels": str(MOST_PIXELS)}
    try:
        if not 0 < path.stat().st_size <= _MOST_BYTES:
            return None
        pictures = [*decoder.decode(av.Packet(path.read_bytes())), *decoder.decode(None)]
    except (av.error.FFmpegError, OSError):
        return None
    return pictures[0] if pictures else None
