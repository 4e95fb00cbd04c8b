"""Opening a film: which containers are read, and what no honest film has.

A film is data that anyone may have made. FFmpeg also reads play lists, which point to other files or into the network,
and takes a name such as ``concat:a|b`` for an instruction; here only containers that hold their film themselves are
read, and only from the file that was named. A few bytes can claim pictures and counts that no memory holds: what is
beyond the limits below is refused, by what is decoded and not by what a header promises.
"""

from __future__ import annotations

import contextlib
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import av

from anglecam.errors import InputError
from anglecam.video.container import is_cut_short

MOST_PIXELS = 8192 * 8192
"""Of a picture: twice those of 8K film (7680 × 4320), as much as one of a dome's films."""
LEAST_SIDE, LONGEST_SIDE = 32, 16_384
"""px; nothing can be measured in less, and OpenCV's remapping ends at 32,767."""
MOST_FRAMES = 1_000_000
"""Nine hours at 30 Hz, two and a half at 120 Hz."""
LONGEST_S = 7 * 24 * 3600.0
"""From the first frame to the last: a week."""
MOST_STREAMS = 64
"""A camera writes a handful: pictures, sound, time code, its own motion."""
_OPENING_BYTES = 768 * 2**20
"""Of memory that opening may take: FFmpeg makes a film's whole index at once, of entries that cost no byte in the file.
`MOST_FRAMES` have 80 MB of it; the rest is for the first pictures, which it decodes to know what they are."""
_ONE_AT_A_TIME = threading.Lock()
"""The limit is the process's: a second thread would take the first one's for what was there before."""
_CONTAINERS = "avi,matroska,webm,mov,mp4,asf,flv,mpegts,mpeg,ogg,nut,mxf"
"""As FFmpeg calls those that carry times of their own and name no other file."""


def open_film(path: Path) -> av.container.InputContainer:
    """Open a film whose first picture stream can be decoded within the limits.

    Parameters
    ----------
    path : Path
        The file, whatever it is called.

    Returns
    -------
    InputContainer
        With at least one video stream; the first one's decoder refuses pictures that are too large.

    Raises
    ------
    InputError
        Where the file is missing, empty, no film, or claims what no film has: one line with the file and the cause.
    """
    if not path.exists():
        raise InputError(f"{path}: no such file")
    if not path.is_file():
        raise InputError(f"{path}: not a file")
    limits = {"max_pixels": str(MOST_PIXELS)}
    try:
        if path.stat().st_size == 0:
            raise InputError(f"{path}: empty file")
        with _little_memory():
            container = av.open(
                f"file:{path}",
                options=limits | {"format_whitelist": _CONTAINERS, "protocol_whitelist": "file"},
                metadata_errors="replace",
            )
    except (av.error.FFmpegError, OSError, ValueError) as error:
        if path.suffix.lower() in (".mp4", ".mov") and is_cut_short(path):
            raise InputError(f"{path}: truncated: its index is missing, no frame can be read") from error
        reason = getattr(error, "strerror", None) or "unknown format"
        raise InputError(f"{path}: not a readable video file ({reason})") from error
    fault = _fault(container)
    if fault is not None:
        container.close()
        raise InputError(f"{path}: {fault}")
    container.streams.video[0].codec_context.options = limits
    return container


@contextlib.contextmanager
def _little_memory() -> Iterator[None]:
    """Let this process take no more than `_OPENING_BYTES` more while the block runs, where the system can see to that.

    What is refused to FFmpeg it reports as an error.
    """
    if not sys.platform.startswith("linux"):
        yield
        return
    import resource

    with _ONE_AT_A_TIME:
        before = resource.getrlimit(resource.RLIMIT_DATA)
        held = int(Path("/proc/self/statm").read_text().split()[5]) * resource.getpagesize()
        limits = [limit for limit in before if limit != resource.RLIM_INFINITY]
        resource.setrlimit(resource.RLIMIT_DATA, (min([held + _OPENING_BYTES, *limits]), before[1]))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_DATA, before)


def _fault(container: av.container.InputContainer) -> str | None:
    """Say what is wrong with what a container declares."""
    if not container.streams.video:
        return "no video stream in it"
    if len(container.streams) > MOST_STREAMS:
        return f"it claims {len(container.streams)} streams; more than {MOST_STREAMS} are not read"
    stream = container.streams.video[0]
    if stream.codec_context is None:
        return "its pictures are coded in a way that is not known"
    width, height = stream.width, stream.height
    if width < 1 or height < 1 or not stream.time_base:
        # the decoder forgets a size that it refuses
        return f"it does not say how large its pictures are, or claims more than {MOST_PIXELS:,} px"
    if min(width, height) < LEAST_SIDE:
        return f"pictures of {width} × {height} px are too small; {LEAST_SIDE} on a side are the least"
    if max(width, height) > LONGEST_SIDE or width * height > MOST_PIXELS:
        return (
            f"it claims pictures of {width} × {height} px; more than {MOST_PIXELS:,} px, or {LONGEST_SIDE:,} on a side,"
            " are not read"
        )
    return None
