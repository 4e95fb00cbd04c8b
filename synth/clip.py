"""Writes pictures to a video file, each with its time stamp. ffv1 is lossless, the other codecs are not.

AVI has no time stamps, only a fixed rate: a gap is written as empty chunks, and H.264 must not use B-frames, or the
times come out wrong. MP4 keeps every time stamp. MKV rounds to milliseconds.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Literal

import av
import numpy as np
from numpy.typing import NDArray

from synth.clock import Timetable, as_fraction
from synth.spec import Camera

Frame = NDArray[np.uint8]

UNFINISHED = ".unfinished-"
"""Prefix of a clip's name while it is being written."""
_ENCODERS: dict[str, Literal["mjpeg", "ffv1", "libx264"]] = {"mjpeg": "mjpeg", "ffv1": "ffv1", "h264": "libx264"}


def file_name(name: str, camera: Camera) -> str:
    """Return the name of a recording's clip."""
    return f"{name}.{camera.suffix}"


@contextlib.contextmanager
def clip_writer(path: Path, camera: Camera, table: Timetable) -> Iterator[Callable[[Frame], None]]:
    """Open a clip for writing; the file gets its final name only when it is complete.

    Parameters
    ----------
    path : Path
        The file to write.
    camera : Camera
        Size and codec.
    table : Timetable
        Time stamps of the frames.

    Yields
    ------
    callable
        Takes the next frame, (height, width, 3), RGB.
    """
    unfinished = path.with_name(f"{UNFINISHED}{path.name}")
    try:
        # bitexact: no version of the encoder in the file, the same bytes for the same frames
        with av.open(str(unfinished), "w", options={"fflags": "+bitexact"}) as container:
            stream = container.add_stream(_ENCODERS[camera.codec], rate=as_fraction(camera.declared_fps or camera.fps))
            stream.width, stream.height = camera.size
            stream.pix_fmt = _pixel_format(camera)
            stream.time_base = stream.codec_context.time_base = table.unit
            stream.codec_context.flags |= av.codec.context.Flags.bitexact
            stream.codec_context.thread_count = 1
            if camera.codec == "mjpeg":
                stream.codec_context.qmin = stream.codec_context.qmax = camera.quality
            elif camera.codec == "h264":
                # x264's macroblock tree reads uninitialised memory, so the same frames would give different bytes
                stream.options = {"crf": str(camera.crf), "x264-params": "mbtree=0"}
                if camera.suffix == "avi":
                    stream.options["bf"] = "0"
            stamps = iter(table.stamps.tolist())

            def write(frame: Frame) -> None:
                picture = av.VideoFrame.from_ndarray(frame, format="rgb24")
                picture.pts, picture.time_base = next(stamps), table.unit
                container.mux(stream.encode(picture))

            yield write
            container.mux(stream.encode(None))
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)


def _pixel_format(camera: Camera) -> str:
    if camera.codec == "ffv1":
        return "bgr0"
    chroma = camera.chroma or (444 if camera.codec == "mjpeg" else 420)
    return f"yuvj{chroma}p" if camera.codec == "mjpeg" else f"yuv{chroma}p"
