"""Decode a film: a time and a picture for each frame, read forward.

Seeking may end on a wrong frame, and headers may state wrong rates and counts. So nothing here seeks, and no time is
derived from a frame's number. A packet that cannot be decoded keeps its row: a frame without a picture.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from pathlib import Path

import av
import numpy as np

from anglecam.data.typing import Image
from anglecam.errors import InputError
from anglecam.threads import native_threads
from anglecam.video.container import LONGEST_S, MOST_FRAMES, open_container
from anglecam.video.truncation import is_cut_short

Row = tuple[float, av.VideoFrame | None]
"""Time, s, and picture of a frame; ``None`` where it cannot be decoded."""


def decode(path: Path) -> Iterator[Row]:
    """Yield a film's rows in the order of presentation.

    Decoders drop some broken packets without an error. So every packet's time stamp is remembered until a picture with
    that time stamp or a later one is returned; time stamps that are left over belong to lost frames. Where a container
    gives packets no presentation time (AVI with reordered frames), only a packet that raises is known to be lost.

    Parameters
    ----------
    path : Path
        The film.

    Yields
    ------
    tuple of (float, VideoFrame or None)
        Time, s, and picture; ``None`` where a packet cannot be decoded or is flagged corrupt.

    Raises
    ------
    InputError
        As `anglecam.video.container.open_container`, and where time stamps do not increase, pictures change their
        size, or the film has no frame, more frames than `MOST_FRAMES` or a longer duration than `LONGEST_S`.
    """
    with open_container(path) as container:
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
        size = stream.width, stream.height  # saved, because the decoder's change when the film does
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
                # AVI stores no presentation times: its frames follow each other from the start. libav derives times
                # from the order of decoding, which are late by the decoder's delay.
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
                    # one picture of another size is damaged; two of the same other size are another film
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
    """Yield each packet with the pictures decoded from it, ``None`` where it could not be decoded."""
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
            # An empty packet would flush the decoder; in AVI it means a frame that was dropped in recording.
            yield packet, None
            continue
        try:
            yield packet, packet.decode()
        except av.error.EOFError:
            return
        except av.error.FFmpegError:
            yield packet, None


def to_colours(picture: av.VideoFrame) -> Image:
    """Convert a picture to (height, width, 3) bytes: blue, green, red."""
    return picture.to_ndarray(format="bgr24", threads=1)  # starting threads takes longer than they save


def to_brightness(picture: av.VideoFrame) -> Image:
    """Return a picture's brightness, (height, width, 1) bytes: the stored plane where there is one, else converted."""
    if not picture.format.name.startswith(("yuv", "nv", "gray")) or picture.format.components[0].bits != 8:
        return picture.to_ndarray(format="gray")[..., None]
    plane = picture.planes[0]
    rows = np.frombuffer(memoryview(plane), np.uint8).reshape(plane.height, plane.line_size)
    return rows[:, : plane.width, None].copy()
