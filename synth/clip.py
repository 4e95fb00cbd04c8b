"""Frames into a file, on an exact fixed grid: frame k stands at k / fps.

AVI for mjpeg and ffv1, MP4 for h264, because AVI gives H.264 wrong times. ffv1 keeps every grey level.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from numpy.typing import NDArray

from synth.spec import Camera

Frame = NDArray[np.uint8]

UNFINISHED = ".unfinished-"
"""How the name of a clip begins while it is being written."""
_PIXELS = {"mjpeg": "yuvj444p", "ffv1": "bgr0", "h264": "yuv420p"}


def file_name(name: str, camera: Camera) -> str:
    """Name of a recording's clip."""
    return f"{name}.{'mp4' if camera.codec == 'h264' else 'avi'}"


def frame_rate(camera: Camera) -> Fraction:
    """Frames per second as the file states it: 29.97 is 30000/1001."""
    whole = Fraction(camera.fps).limit_denominator(1001)
    ntsc = Fraction(round(camera.fps * 1.001) * 1000, 1001)
    return ntsc if abs(float(ntsc) - camera.fps) < 0.005 and whole.denominator != 1 else whole


@contextlib.contextmanager
def clip_writer(path: Path, camera: Camera) -> Iterator[Callable[[Frame], None]]:
    """Open a clip; it stands under its name only when it is whole.

    Parameters
    ----------
    path : Path
        The file to be.
    camera : Camera
        Size, rate and codec.

    Yields
    ------
    callable
        Takes the next frame, (height, width, 3), RGB.
    """
    unfinished = path.with_name(f"{UNFINISHED}{path.name}")
    try:
        # bitexact: no version of the encoder in the file, the same bytes for the same frames
        with av.open(str(unfinished), "w", options={"fflags": "+bitexact"}) as container:
            rate = frame_rate(camera)
            stream = container.add_stream(camera.codec if camera.codec != "h264" else "libx264", rate=rate)
            stream.width, stream.height = camera.size
            stream.pix_fmt = _PIXELS[camera.codec]
            stream.codec_context.flags |= av.codec.context.Flags.bitexact
            stream.codec_context.thread_count = 1
            if camera.codec == "mjpeg":
                stream.codec_context.qmin = stream.codec_context.qmax = camera.quality
            elif camera.codec == "h264":
                stream.options = {"crf": str(camera.crf)}
            count = 0

            def write(frame: Frame) -> None:
                nonlocal count
                picture = av.VideoFrame.from_ndarray(frame, format="rgb24")
                picture.pts, picture.time_base = count, 1 / rate
                count += 1
                container.mux(stream.encode(picture))

            yield write
            container.mux(stream.encode(None))
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)
