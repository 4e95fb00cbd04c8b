"""Decode a film from a key frame on, each picture identified by its own stamp: a seek may end on a wrong frame."""

from __future__ import annotations

from collections.abc import Iterator

import av
from av.video.frame import PictureType

from anglecam.video.frame_index import FrameIndex


class IrregularFilmError(Exception):
    """A picture is not where the index says, or cannot be decoded."""


def decode_from_key(
    container: av.container.InputContainer, index: FrameIndex, number: int
) -> Iterator[tuple[int, av.VideoFrame]]:
    """Yield the frames from the key frame before one to the last of the film.

    Parameters
    ----------
    container : InputContainer
        The open film.
    index : FrameIndex
        Of the film.
    number : int
        The frame that is wanted first; the film's first frame has 0.

    Yields
    ------
    tuple of (int, VideoFrame)
        Number and picture, without gaps.

    Raises
    ------
    IrregularFilmError
        Where a frame is missing, damaged or not what it should be.
    """
    key = index.key_before(number)
    if key is None:
        raise IrregularFilmError
    stream, is_avi = container.streams.video[0], container.format.name == "avi"
    expected: int | None = None
    started = False
    try:
        container.seek(key, stream=stream, backward=True)
        for packet in container.demux(stream):
            if is_avi:
                packet.pts = packet.dts
            for picture in packet.decode():
                if picture.pts is None or picture.pts < key:  # perhaps without the pictures it was predicted from
                    continue
                if not started and not _is_key(picture, key):
                    raise IrregularFilmError
                started = True
                at = index.number_of(picture.pts)
                if at is None:  # hidden by an edit list
                    continue
                if picture.is_corrupt or (expected is not None and at != expected):
                    raise IrregularFilmError
                expected = at + 1
                yield at, picture
    except av.error.FFmpegError as error:
        raise IrregularFilmError from error


def _is_key(picture: av.VideoFrame, key: int) -> bool:
    """Return whether a picture is the key frame with a stamp, and was decoded without any other."""
    return picture.pts == key and picture.key_frame and picture.pict_type == PictureType.I
