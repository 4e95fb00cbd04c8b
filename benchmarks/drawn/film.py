"""One film: drawn from its kind and its seed alone, encoded, with the truth."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np

from benchmarks.drawn.camera import Camera
from benchmarks.drawn.canvas import Canvas, pick
from benchmarks.drawn.faults import Faults, draw_faults, own_time, paint_people, room, stamps
from benchmarks.drawn.kinds import KINDS
from benchmarks.drawn.mechanism import Stage

SIZES = (
    (320, 240),
    (480, 360),
    (640, 480),
    (640, 480),
    (640, 360),
    (854, 480),
    (960, 540),
    (1280, 720),
    (486, 362),
    (718, 404),
    (404, 718),
)
"""Width and height, px; some are no multiples of 16, one is upright."""
RATES = (15, 24, 25, 30, 30, 50, 60)
FORMATS = (
    ("libx264", "mp4"),
    ("libx264", "mp4"),
    ("libx264", "mov"),
    ("libx264", "mkv"),
    ("libx265", "mp4"),
    ("mjpeg", "avi"),
    ("mjpeg", "mov"),
    ("mpeg4", "avi"),
)
CLOCK = 90_000
"""Ticks of a container's clock in a second."""


@dataclass(frozen=True)
class Drawn:
    """A film and its truth."""

    name: str
    path: Path
    faults: Faults
    codec: str
    size: tuple[int, int]
    times_s: np.ndarray
    """(n,) of the frames."""
    angles_deg: dict[str, np.ndarray]
    """Of every moving part (n,), counter-clockwise as seen, at the middle of the middle row's exposure."""
    pivot_px: np.ndarray
    """(2,) in the first frame of a camera at rest."""
    grip_px: np.ndarray
    """(2,) where a hand would take it, in the same frame."""


def draw(kind: str, seed: int, folder: Path) -> Drawn:
    """Draw a film and write it.

    Parameters
    ----------
    kind : str
        A key of `KINDS`.
    seed : int
        Any; the same kind and seed give the same film.
    folder : Path
        It is written to ``folder``/KIND-SEED.

    Returns
    -------
    Drawn
        The film's path and truth.
    """
    cv2.setNumThreads(1)
    rng = np.random.default_rng([seed, zlib.crc32(kind.encode())])
    width, height = pick(rng, SIZES)
    fps = float(pick(rng, RATES))
    frames = min(250, max(int(rng.integers(60, 251)), int(2.5 * fps)))
    stage = Stage(rng, width, height, fps, frames)
    faults = draw_faults(stage)
    mechanism = KINDS[kind](stage)
    scenery = room(stage, faults) if mechanism.scenery is None else mechanism.scenery
    times = stamps(stage, faults)

    def paint(canvas: Canvas, t: float) -> None:
        played = own_time(t, faults.released_s)
        pose = mechanism.pose(played)
        mechanism.paint(canvas, pose, played)
        paint_people(canvas, stage, faults, t, np.asarray(mechanism.grip(pose)))

    camera = Camera(stage, faults, scenery, paint)
    uneven = "stamps" in faults.names
    codec, ending = pick(rng, [one for one in FORMATS if not (uneven and one[1] == "avi")])
    path = folder / f"{kind}-{seed}.{ending}"
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=Fraction(int(fps)), options=_options(codec, rng, faults))
        stream.width, stream.height = width, height
        stream.pix_fmt = "yuvj420p" if codec == "mjpeg" else "yuv420p"
        stream.codec_context.thread_count = 1
        if codec == "mpeg4":
            stream.bit_rate = 400_000 if "lowrate" in faults.names else 6_000_000
        if uneven:
            stream.codec_context.time_base = stream.time_base = Fraction(1, CLOCK)
        for k, t in enumerate(times):
            picture = av.VideoFrame.from_ndarray(camera.frame(float(t), rng), format="bgr24")
            if codec == "mjpeg":
                picture = picture.reformat(format="yuvj420p")
            if uneven:
                picture.pts, picture.time_base = round(CLOCK * t), Fraction(1, CLOCK)
            else:
                picture.pts, picture.time_base = k, 1 / Fraction(int(fps))
            container.mux(stream.encode(picture))
        container.mux(stream.encode())
    poses = [mechanism.pose(own_time(float(t), faults.released_s)) for t in times]
    angles = {part: np.array([pose[part] for pose in poses]) for part in poses[0]}
    pivot, grip = np.asarray(mechanism.pivot), np.asarray(mechanism.grip(poses[0]))
    return Drawn(path.stem, path, faults, codec, (width, height), times, angles, pivot, grip)


def _options(codec: str, rng: np.random.Generator, faults: Faults) -> dict[str, str]:
    quality = int(rng.integers(16, 27)) + (10 if "lowrate" in faults.names else 0)
    if codec == "libx264":
        # the tree over macroblocks reads memory that nothing wrote where the width is no multiple of 16
        return {"crf": str(quality), "preset": "veryfast", "x264-params": "mbtree=0"}
    if codec == "libx265":
        return {"crf": str(quality), "preset": "veryfast", "x265-params": "log-level=error:pools=1"}
    coarse = 12 if "lowrate" in faults.names else 0
    return {"qmin": str(2 + coarse), "qmax": str((4 if codec == "mjpeg" else 5) + coarse)}
