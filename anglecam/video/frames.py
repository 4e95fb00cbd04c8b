"""Frames of a clip with their own timestamps, read forward, one at a time.

Seeking lands on wrong frames and headers lie about rates and counts, so nothing here seeks and no time comes from
a frame's number. A packet that cannot be decoded keeps its row: a frame without an image.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import av
import numpy as np
from av.video.frame import PictureType

from anglecam.data.typing import Image
from anglecam.errors import InputError
from anglecam.threads import native_threads
from anglecam.video.container import is_cut_short
from anglecam.video.film import reread
from anglecam.video.opening import LONGEST_S, MOST_FRAMES, open_film

_PREDICTED = (PictureType.P, PictureType.B)


@dataclass(frozen=True)
class Frame:
    """One frame of a clip."""

    index: int
    """0 for the first."""
    time: float
    """Presentation time, s, on the clip's own clock."""
    image: Image | None
    """(height, width, 3) blue, green, red, or (height, width, 1) brightness; ``None`` where the data cannot be
    decoded."""
    predicted: bool = False
    """Whether the codec made it from other frames."""


@dataclass(frozen=True)
class ClipInfo:
    """What a clip's container says about it."""

    path: Path
    width: int
    """px."""
    height: int
    """px."""
    declared_frames: int
    """The container's own count, 0 where it states none. It may be wrong in an intact file."""
    codec: str
    """As FFmpeg calls it, such as ``h264``."""
    coarse_colour: bool
    """Whether colour is stored at a lower resolution than brightness."""
    cut_short: bool
    """Whether bytes are missing at the end of the file."""


@dataclass(frozen=True)
class Sample:
    """Evenly spread frames of a whole clip."""

    frames: tuple[Frame, ...]
    """Those that could be decoded."""
    count: int
    """Frames in the clip, those without an image included."""
    decoded: int
    """Frames with an image."""


def inspect_clip(path: Path) -> ClipInfo:
    """Open a clip and read what its container declares.

    Parameters
    ----------
    path : Path
        The film.

    Returns
    -------
    ClipInfo
        Size, declared number of frames, and whether the file ends too early.

    Raises
    ------
    InputError
        As `anglecam.video.opening.open_film`.
    """
    with open_film(path) as container:
        stream = container.streams.video[0]
        planes = stream.codec_context.format.components if stream.codec_context.format else ()
        coarse = any(plane.width < stream.width for plane in planes)
        codec = stream.codec_context.name
        return ClipInfo(path, stream.width, stream.height, stream.frames, codec, coarse, is_cut_short(path))


def read_frames(path: Path, *, brightness: bool = False) -> Iterator[Frame]:
    """Yield every frame of a clip in the order of presentation; memory does not grow with its length.

    Parameters
    ----------
    path : Path
        The film.
    brightness : bool
        Give the brightness alone, as the codec stored it, not colours.

    Yields
    ------
    Frame
        With ``image=None`` where a packet does not decode or is flagged corrupt.

    Raises
    ------
    InputError
        As `inspect_clip`, and where timestamps do not increase, pictures change their size, there is no frame at all,
        or more of them, or a longer time, than any film has.
    """
    for index, (time, picture) in enumerate(reread(path, _decode)):
        image = None if picture is None else _brightness(picture) if brightness else _colours(picture)
        predicted = picture is not None and picture.pict_type in _PREDICTED
        yield Frame(index, time, image, predicted)


def sample_frames(path: Path, most: int) -> Sample:
    """Decode a whole clip and keep at most ``most`` evenly spaced frames of it.

    The length of the clip is not known beforehand: when more than ``most`` are kept, every second one is dropped
    and the stride doubles.

    Parameters
    ----------
    path : Path
        The film.
    most : int
        Upper limit of frames to keep, at least 2.

    Returns
    -------
    Sample
        Between half of ``most`` and ``most`` frames, all of a shorter clip.

    Raises
    ------
    InputError
        As `read_frames`.
    """
    kept: list[Frame] = []
    stride, count, decoded = 1, 0, 0
    for index, (time, picture) in enumerate(reread(path, _decode)):
        count += 1
        decoded += picture is not None
        if index % stride or picture is None:
            continue
        kept.append(Frame(index, time, _colours(picture)))
        if len(kept) > most:
            stride *= 2
            kept = [frame for frame in kept if frame.index % stride == 0]
    return Sample(tuple(kept), count, decoded)


def _decode(path: Path) -> Iterator[tuple[float, av.VideoFrame | None]]:
    """Yield (time in s, picture or None) in the order of presentation.

    Decoders drop some broken packets without an error, so every packet's timestamp is remembered until a picture
    with that timestamp, or a later one, comes out: what is left behind was lost. Where a container gives packets
    no presentation time (AVI with reordered frames), only a packet that raises is known to be lost.
    """
    with open_film(path) as container:
        stream = container.streams.video[0]
        stream.codec_context.thread_type = "SLICE"
        stream.codec_context.thread_count = native_threads()
        base = float(stream.time_base or 0.0)
        is_avi = container.format.name == "avi"
        pending: list[int] = []
        broken: set[int] = set()
        first: int | None = None
        last: int | None = None
        delay: int | None = None
        size = stream.width, stream.height  # the decoder's own change when a film changes in the middle
        other: tuple[int, int] | None = None

        def row(pts: int, picture: av.VideoFrame | None) -> tuple[float, av.VideoFrame | None]:
            nonlocal first, last
            first = pts if first is None else first
            if last is not None and pts <= last:
                raise InputError(f"{path}: timestamps do not increase at {pts * base:g} s")
            if (pts - first) * base > LONGEST_S:
                raise InputError(f"{path}: frames at {first * base:g} s and at {pts * base:g} s; a week is the longest")
            last = pts
            return (pts - (delay or 0)) * base, picture

        for number, (packet, pictures) in enumerate(_packets(path, container, stream)):
            if number > MOST_FRAMES:
                raise InputError(f"{path}: more than {MOST_FRAMES:,} frames are not read")
            stamp = packet.pts if packet.pts is not None else packet.dts
            if delay is None and stamp is not None:
                # AVI holds no presentation times: the frames follow each other from its start. libav makes them
                # up from the order of decoding, late by the decoder's delay.
                delay = stamp - (packet.dts if packet.dts is not None else stamp) if is_avi else 0
            if packet.pts is not None:
                heapq.heappush(pending, packet.pts)
            if stamp is not None and (packet.is_corrupt or pictures is None):
                broken.add(stamp)
                if packet.pts is None:
                    heapq.heappush(pending, stamp)
            for picture in pictures or ():
                pts = picture.pts if picture.pts is not None else picture.dts
                if pts is None:
                    raise InputError(f"{path}: frames without timestamps")
                while pending and pending[0] < pts:
                    yield row(heapq.heappop(pending), None)
                if pending and pending[0] == pts:
                    heapq.heappop(pending)
                usable = not (picture.is_corrupt or pts in broken)
                broken.discard(pts)
                shown = picture.width, picture.height
                if shown != size:
                    # a single one is a damaged picture; two of the same other size are another film
                    if shown == other:
                        raise InputError(
                            f"{path}: pictures of {shown[0]} × {shown[1]} px at {pts * base:g} s, not of"
                            f" {size[0]} × {size[1]} as its header says; cut the film there"
                        )
                    usable = False
                other = None if shown == size else shown
                yield row(pts, picture if usable else None)
        while pending:
            yield row(heapq.heappop(pending), None)
        if last is None:
            cut = is_cut_short(path)
            raise InputError(f"{path}: truncated before its first frame" if cut else f"{path}: no frames in it")


def _packets(
    path: Path, container: av.container.InputContainer, stream: av.VideoStream
) -> Iterator[tuple[av.Packet, list[av.VideoFrame] | None]]:
    """Yield each packet with the pictures that came out after it, ``None`` where it could not be decoded."""
    packets = container.demux(stream)
    while True:
        try:
            packet = next(packets)
        except StopIteration:
            return
        except av.error.FFmpegError as error:
            if is_cut_short(path):
                return
            raise InputError(f"{path}: cannot be read to its end ({error.strerror})") from error
        if packet.size == 0 and packet.dts is not None:
            # An empty packet would flush the decoder; in AVI it stands for a frame that was dropped in recording.
            yield packet, None
            continue
        try:
            yield packet, packet.decode()
        except av.error.EOFError:
            return
        except av.error.FFmpegError:
            yield packet, None


def _colours(picture: av.VideoFrame) -> Image:
    return picture.to_ndarray(format="bgr24", threads=1)  # starting more takes longer than they save


def _brightness(picture: av.VideoFrame) -> Image:
    """Take the brightness as it is stored where it has a plane of its own: colour comes into it by no conversion."""
    if not picture.format.name.startswith(("yuv", "nv", "gray")) or picture.format.components[0].bits != 8:
        return picture.to_ndarray(format="gray")[..., None]
    plane = picture.planes[0]
    rows = np.frombuffer(memoryview(plane), np.uint8).reshape(plane.height, plane.line_size)
    return rows[:, : plane.width, None].copy()
