"""Decode a film: a time and a picture for each frame, read forward.

Seeking may end on a wrong frame, and headers may state wrong rates and counts. So nothing here seeks, and no time is
derived from a frame's number. A packet that cannot be decoded keeps its row: a frame without a picture.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path

import av
from av.video.frame import PictureType

from anglecam.errors import InputError
from anglecam.threads import native_threads, picture_threads
from anglecam.video.container import LONGEST_S, MOST_FRAMES, open_container
from anglecam.video.stamps import CountedStamps, PresentationStamps
from anglecam.video.truncation import is_cut_short

Row = tuple[float, av.VideoFrame | None]
"""Time, s, and picture of a frame; ``None`` where it cannot be decoded."""


PREDICTING_CODECS = ("h264", "hevc")
"""Pictures of these are predicted from others. Several are decoded at once, each by a thread, since they are seldom cut
into slices; where key frames suffice, the others can be left out."""
_PREDICTED_FROM = 16
"""A picture is predicted from none that is shown more than so many places later: these codecs keep no more."""
INTRA_CODECS = ("mjpeg", "prores", "dnxhd", "huffyuv", "ffvhuff", "utvideo", "rawvideo")
"""Every packet of these is a picture of its own, which is decoded without the others."""
Wants = Callable[[int], bool]
"""Whether the picture of the row with a given number is wanted; the first row has 0."""


class _IrregularError(Exception):
    """A film is not intact."""


def decode(path: Path, wants: Wants | None = None) -> Iterator[Row]:
    """Yield a film's rows in the order of presentation.

    A packet that the container marks to be discarded is no frame: an edit list leaves out the start of a film that was
    trimmed, but the decoder needs it as reference.

    While a film is intact, several of its pictures may be decoded at once. From the first irregularity on it is decoded
    again picture by picture, because a decoder with several threads does not say which packet it could not decode.

    Parameters
    ----------
    path : Path
        The film.
    wants : callable, optional
        Which pictures of a codec in `INTRA_CODECS` are wanted; the other rows have none.

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
    intact = 0
    with open_container(path) as container:
        if native_threads() == 1 or not may_skip(container):
            yield from decode_container(path, container, wants)
            return
        try:
            for row in _decode_intact(path, container):
                yield row
                intact += 1
            return
        except (_IrregularError, InputError):
            pass
    with open_container(path) as container:
        yield from islice(decode_container(path, container, wants), intact, None)


def decode_keys(path: Path) -> Iterator[Row]:
    """Yield a film's rows, those alone with a picture that are decoded without any other.

    Parameters
    ----------
    path : Path
        The film; its container states when each packet is presented.

    Yields
    ------
    tuple of (float, VideoFrame or None)
        Time, s, and picture.

    Raises
    ------
    InputError
        As `decode`.
    """
    with open_container(path) as container:
        container.streams.video[0].codec_context.skip_frame = "NONKEY"
        for time, picture in decode_container(path, container, threads="FRAME"):
            # a stream that is refreshed in strips has key frames that need others
            alone = picture is not None and picture.pict_type == PictureType.I
            yield time, picture if alone else None


def may_skip(container: av.container.InputContainer) -> bool:
    """Return whether `decode_keys` can decode a film: AVI does not state which pictures are missing."""
    return container.format.name != "avi" and container.streams.video[0].codec_context.name in PREDICTING_CODECS


def _decode_intact(path: Path, container: av.container.InputContainer) -> Iterator[Row]:
    """Yield the rows of an intact film, several of which are decoded at once; raise at the first irregularity.

    A row waits until those are decoded from which it may have been predicted.
    """
    waiting: deque[Row] = deque()
    for row in decode_container(path, container, threads="FRAME"):
        if row[1] is None:
            raise _IrregularError
        waiting.append(row)
        if len(waiting) > _PREDICTED_FROM:
            yield waiting.popleft()
    yield from waiting


def decode_container(
    path: Path,
    container: av.container.InputContainer,
    wants: Wants | None = None,
    packets: Iterator[av.Packet] | None = None,
    threads: str = "SLICE",
) -> Iterator[Row]:
    """Yield the rows of a film that is open, and of which nothing was decoded; see `decode`.

    ``packets`` are those of its first video stream, where something else takes them from the container. ``threads`` is
    what each of the decoder's threads decodes: a ``SLICE`` of a picture, or a ``FRAME``.
    """
    stream = container.streams.video[0]
    packets = container.demux(stream) if packets is None else packets
    decoder = stream.codec_context
    decoder.thread_type = threads
    # with several threads for the slices of a picture, FFmpeg does not flag one that is damaged
    alone = threads == "SLICE" and decoder.name in PREDICTING_CODECS
    decoder.thread_count = 1 if alone else picture_threads() if threads == "FRAME" else native_threads()
    base = float(stream.time_base or 0.0)
    is_avi = container.format.name == "avi"
    stamps = CountedStamps(decoder) if is_avi else PresentationStamps()
    one_size = OneSize(path, (stream.width, stream.height))  # saved, because the decoder's changes with the film
    first: int | None = None
    last: int | None = None

    def row(stamp: int, picture: av.VideoFrame | None) -> Row:
        nonlocal first, last
        first = stamp if first is None else first
        if last is not None and stamp <= last:
            raise InputError(f"{path}: timestamps do not increase at {stamp * base:g} s")
        if (stamp - first) * base > LONGEST_S:
            raise InputError(f"{path}: frames at {first * base:g} s and at {stamp * base:g} s; a week is the longest")
        last = stamp
        return stamp * base, picture

    for number, (packet, pictures) in enumerate(_decoded_packets(path, packets, is_avi, wants)):
        if number > MOST_FRAMES:
            raise InputError(f"{path}: more than {MOST_FRAMES:,} frames are not read")
        if not packet.is_discard:
            stamps.expect(packet, is_lost=packet.is_corrupt or pictures is None)
        for picture in pictures or ():
            lost, stamp, intact = stamps.place(picture)
            for one in lost:
                yield row(one, None)
            if stamp is None:
                raise InputError(f"{path}: frames without timestamps")
            fits = one_size.allows(picture, stamp * base)
            yield row(stamp, picture if fits and intact and not picture.is_corrupt else None)
    for one in stamps.left():
        yield row(one, None)
    if last is None:
        cut = is_cut_short(path)
        raise InputError(f"{path}: truncated before its first frame" if cut else f"{path}: no frames in it")


class OneSize:
    """Refuses pictures of another size than the first: one of them is damaged, two alike are another film.

    Parameters
    ----------
    path : Path
        The film, for the message.
    size : tuple of int
        Width and height that the film's header states, px.
    """

    def __init__(self, path: Path, size: tuple[int, int]) -> None:
        self._path, self._size = path, size
        self._other: tuple[int, int] | None = None

    def allows(self, picture: av.VideoFrame, time: float) -> bool:
        """Return whether a picture has the film's size.

        Raises
        ------
        InputError
            Where two pictures in a row have the same other size; ``time``, s, is that of the second.
        """
        size = picture.width, picture.height
        if size != self._size and size == self._other:
            raise InputError(
                f"{self._path}: pictures of {size[0]} × {size[1]} px at {time:g} s, not of"
                f" {self._size[0]} × {self._size[1]} as its header says; cut the film there"
            )
        self._other = None if size == self._size else size
        return size == self._size


def _decoded_packets(
    path: Path, packets: Iterator[av.Packet], number_them: bool, wants: Wants | None
) -> Iterator[tuple[av.Packet, list[av.VideoFrame] | None]]:
    """Yield each packet with the pictures decoded from it, ``None`` where it is not wanted or cannot be decoded."""
    row = -1
    while True:
        try:
            packet = next(packets)
        except StopIteration:
            return
        except av.error.FFmpegError as error:
            if is_cut_short(path):
                return
            raise InputError(f"{path}: cannot be read to its end ({error.strerror})") from error
        row += not packet.is_discard
        if packet.size == 0 and packet.dts is not None:
            # An empty packet would flush the decoder; in AVI it means a frame that was dropped in recording.
            yield packet, None
            continue
        if number_them:
            packet.pts = packet.dts
        if packet.size and wants is not None and not wants(row):
            yield packet, None
            continue
        try:
            yield packet, packet.decode()
        except av.error.EOFError:
            return
        except av.error.FFmpegError:
            yield packet, None
