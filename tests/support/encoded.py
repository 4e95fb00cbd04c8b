"""Films of given pictures in any codec and container, with what a container says about showing them."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path

import av
import numpy as np

LOSSLESS = {"codec": "libx264rgb", "pix_fmt": "bgr24", "options": {"qp": "0", "preset": "ultrafast"}}
"""H.264 without loss, in colours at full resolution, for MP4."""
INTERLACED_DCT, INTERLACED_ME = 1 << 18, 1 << 29
"""FFmpeg's AV_CODEC_FLAG_INTERLACED_DCT and _ME."""


def encode(
    path: Path,
    pictures: Iterable[np.ndarray],
    *,
    codec: str = "libx264",
    pix_fmt: str = "yuv420p",
    options: dict[str, str] | None = None,
    rate_hz: int = 30,
    aspect: Fraction | None = None,
    matrix: list[int] | None = None,
    rotation: int = 0,
    hflip: bool = False,
    interlaced: bool = False,
) -> Path:
    """Write pictures, (h, w, 3) blue, green, red or in the layout of ``pix_fmt``, and return the path.

    ``matrix`` is the display matrix, ``rotation`` a counter-clockwise one that players apply, and ``hflip`` a mirror
    after it.
    """
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=rate_hz, options=options or {})
        for k, picture in enumerate(pictures):
            frame = _frame(picture, pix_fmt)
            if k == 0:
                stream.width, stream.height, stream.pix_fmt = frame.width, frame.height, pix_fmt
                if aspect is not None:
                    stream.codec_context.sample_aspect_ratio = aspect
                if matrix is not None:
                    stream.set_display_matrix(matrix)
                elif rotation or hflip:
                    stream.set_display_rotation(rotation, hflip=hflip)
                if interlaced:
                    stream.codec_context.flags |= INTERLACED_DCT | INTERLACED_ME
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def trim(whole: Path, path: Path, start_s: float) -> Path:
    """Cut the start of an MP4 off without encoding it again, as ``ffmpeg -ss START -i WHOLE -c copy`` does.

    The packets from the key frame before the start on are kept; an edit list leaves out what comes before the start.
    """
    with av.open(str(whole)) as source, av.open(str(path), "w") as target:
        stream = source.streams.video[0]
        copy = target.add_stream_from_template(stream)
        start = round(start_s / stream.time_base)
        source.seek(start, stream=stream)
        for packet in source.demux(stream):
            if packet.dts is not None:
                packet.pts -= start
                packet.dts -= start
                packet.stream = copy
                target.mux(packet)
    return path


def _frame(picture: np.ndarray, pix_fmt: str) -> av.VideoFrame:
    if picture.ndim == 3:
        return av.VideoFrame.from_ndarray(picture, format="bgr24")
    return av.VideoFrame.from_ndarray(picture, format=pix_fmt)
