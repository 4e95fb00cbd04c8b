"""Open a film's container within limits.

A film may come from anybody. FFmpeg also reads play lists, which point to other files or into the network, and
interprets a name such as ``concat:a|b`` as an instruction. Only containers that hold their film themselves are read
here, and only from the named file. A few bytes can claim pictures and counts that exceed any memory. Whatever exceeds
the limits below is refused, judged by what is decoded and not by what a header promises.
"""

from __future__ import annotations

import contextlib
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import av

from anglecam.errors import InputError
from anglecam.io.files import require_film_file
from anglecam.video.truncation import is_cut_short

MOST_PIXELS = 8192 * 8192
"""Per picture: twice those of 8K film (7680 × 4320), as many as in films for domes."""
LEAST_SIDE, LONGEST_SIDE = 32, 16_384
"""px; a smaller picture shows nothing to measure, and OpenCV's remapping ends at 32,767."""
MOST_FRAMES = 1_000_000
"""Nine hours at 30 Hz, two and a half at 120 Hz."""
LONGEST_S = 7 * 24 * 3600.0
"""From the first frame to the last, s: a week."""
MOST_STREAMS = 64
"""A camera writes a few: pictures, sound, time code, its motion."""
_OPENING_BYTES = 768 * 2**20
"""Memory that opening may take. FFmpeg builds a film's whole index at once, and an entry may cost no byte in the file.
The index of `MOST_FRAMES` takes 80 MB; the rest is for the first pictures, which FFmpeg decodes to learn the format."""
_ONE_AT_A_TIME = threading.Lock()
"""The memory limit holds for the process: a second thread would mistake the first one's limit for the original."""
_CONTAINERS = "avi,matroska,webm,mov,mp4,asf,flv,mpegts,mpeg,ogg,nut,mxf,gif"
"""FFmpeg's names of the containers that store time stamps and refer to no other file."""

_UNTIMED = ("mjpeg", "mpjpeg", "h264", "hevc", "m4v")
"""The same of pictures without time stamps: FFmpeg would assume 25 a second."""
_STREAMS = ",".join([_CONTAINERS, *_UNTIMED, "ivf", "yuv4mpegpipe", "rtsp", "rtp", "sdp"])
"""The same of what a pipe or a network stream may be; those without time stamps are named when they are refused."""
_PROTOCOLS = "pipe,file,rtsp,rtp,udp,tcp,http,https,tls,crypto"
"""FFmpeg's names of the protocols of pipes and network streams."""
_PATIENCE_S = (20.0, 20.0)
"""Longest waits for a stream to open, and for its next packet, s."""


def open_container(path: Path) -> av.container.InputContainer:
    """Open a film whose first picture stream can be decoded within the limits.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    InputContainer
        With at least one video stream; its decoder refuses pictures that are too large.

    Raises
    ------
    InputError
        Where the file is missing, empty, not a film, or beyond the limits: one line with the file and the cause.
    """
    require_film_file(path)
    limits = {"max_pixels": str(MOST_PIXELS)}
    try:
        with _limited_memory():
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


def open_stream(address: str, name: str, form: str | None = None) -> av.container.InputContainer:
    """Open a camera, a pipe or a network stream whose pictures can be decoded within the limits.

    Parameters
    ----------
    address : str
        Of the device, the pipe or the stream, as FFmpeg writes it.
    name : str
        For messages.
    form : str, optional
        FFmpeg's name of the device's kind.

    Returns
    -------
    InputContainer
        As from `open_container`.

    Raises
    ------
    InputError
        Where it cannot be opened, does not answer, or is beyond the limits: one line with the name and the cause.
    """
    limits = {"max_pixels": str(MOST_PIXELS)}
    tries = [{"input_format": "mjpeg"}, {}]  # a camera compresses its pictures if it can
    if form is None:
        tries = [{"format_whitelist": _STREAMS, "protocol_whitelist": _PROTOCOLS}]
    for own in tries:
        try:
            container = av.open(
                address, format=form, options=limits | own, metadata_errors="replace", timeout=_PATIENCE_S
            )
            break
        except (av.error.FFmpegError, OSError, ValueError) as error:
            cause = getattr(error, "strerror", None) or "unknown format"
    else:
        raise InputError(f"{name}: cannot be opened ({cause})")
    fault = _fault(container)
    if container.format.name in _UNTIMED:
        fault = "pictures without time stamps; send them in a container, such as MPEG-TS or Matroska"
    if fault is not None:
        container.close()
        raise InputError(f"{name}: {fault}")
    container.streams.video[0].codec_context.options = limits
    return container


@contextlib.contextmanager
def _limited_memory() -> Iterator[None]:
    """Limit this process to `_OPENING_BYTES` of additional memory while the block runs, where the system can do so.

    FFmpeg reports memory that is refused as an error.
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
    """Return what is wrong with a container's declarations, ``None`` where nothing is."""
    if not container.streams.video:
        return "no video stream in it"
    if len(container.streams) > MOST_STREAMS:
        return f"it claims {len(container.streams)} streams; more than {MOST_STREAMS} are not read"
    stream = container.streams.video[0]
    if stream.codec_context is None:
        return "its pictures have an unknown codec"
    width, height = stream.width, stream.height
    if width < 1 or height < 1 or not stream.time_base:
        # a decoder that refuses a size reports none
        return f"it does not say how large its pictures are, or claims more than {MOST_PIXELS:,} px"
    if min(width, height) < LEAST_SIDE:
        return f"pictures of {width} × {height} px are too small; {LEAST_SIDE} on a side are the least"
    if max(width, height) > LONGEST_SIDE or width * height > MOST_PIXELS:
        return (
            f"it claims pictures of {width} × {height} px; more than {MOST_PIXELS:,} px, or {LONGEST_SIDE:,} on a side,"
            " are not read"
        )
    return None
