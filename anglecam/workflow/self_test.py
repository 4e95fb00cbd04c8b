"""The self-test: measure a short drawn film whose angle is known.

The film shows a stick with a coloured dot at its end, turning about a round mark, in one second at 30 Hz. Each pixel's
value is the share of it that a shape covers, so the true angle is known far better than it is measured.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from tempfile import TemporaryDirectory

import av
import numpy as np

from anglecam.data.typing import Floats
from anglecam.workflow.clip import measure_source, open_source

RATE_HZ, FRAMES = 30, 30
AMPLITUDE_DEG = 12.0
WIDTH, HEIGHT = 240, 180
PIVOT_PX, LEVER_PX = (60.3, 120.6), 120.0
NEUTRAL_DEG = 20.0
"""Direction of the stick in the middle of its swing."""
NOISE = 2.0
"""Standard deviation of the drawn noise, grey levels."""
STICK, DOT, DISC = (70, 70, 75), (40, 35, 190), (16, 16, 18)
"""Blue, green, red."""


@dataclass(frozen=True)
class SelfTest:
    """The result of measuring the drawn film."""

    frames: int
    measured: int
    rms_error: float
    """RMS difference of the angle from the truth, rad; a difference that all frames share is left out, because neutral
    is the median of the measured angles."""
    rms_sigma: float
    """RMS of the stated standard uncertainty, rad."""
    duration_s: float
    """Wall time of a second measurement, whose kernels the first one has compiled."""


def self_test() -> SelfTest:
    """Draw the film in a temporary folder, measure it twice, and compare with the truth.

    The first measurement compiles the kernels where they are not in the cache, for up to a minute; the second one shows
    how fast this machine measures.

    Raises
    ------
    InputError
        If the film cannot be measured.
    """
    true = np.radians(AMPLITUDE_DEG) * np.sin(2.0 * np.pi * np.arange(FRAMES) / FRAMES)
    with TemporaryDirectory(prefix="anglecam-") as folder:
        clip = Path(folder) / "self-test.mkv"
        write_film(clip, true)
        measure_source(open_source(clip))
        began = time.monotonic()
        series = measure_source(open_source(clip)).series
        duration = time.monotonic() - began
    ok = series.ok
    error = series.angle[ok] - true[ok]
    return SelfTest(
        frames=len(ok),
        measured=int(ok.sum()),
        rms_error=float(np.std(error)),
        rms_sigma=float(np.sqrt(np.mean(series.sigma[ok] ** 2))),
        duration_s=duration,
    )


def write_film(path: Path, angles: Floats) -> None:
    """Draw a film, a frame for each angle, and write it as FFV1, which is lossless.

    Parameters
    ----------
    path : Path
        A ``.mkv`` file.
    angles : (n,) ndarray
        Angle from the middle of the swing in each frame, rad.
    """
    noise = np.random.default_rng(1)
    with av.open(str(path), mode="w") as container:
        stream = container.add_stream("ffv1", rate=Fraction(RATE_HZ))
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "bgr0"
        for angle in angles:
            picture = _frame(float(angle)) + noise.normal(0.0, NOISE, (HEIGHT, WIDTH, 3))
            levels = np.clip(np.round(picture), 0, 255).astype(np.uint8)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(levels, format="bgr24")))
        container.mux(stream.encode())


def _frame(angle: float) -> Floats:
    """Return the picture at an angle, (h, w, 3) grey levels of blue, green and red."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH].astype(float)
    picture = np.repeat((150.0 + 0.15 * x + 0.1 * y)[..., None], 3, axis=2)
    line = np.radians(NEUTRAL_DEG) + angle
    along = np.array([np.cos(line), -np.sin(line)])
    dx, dy = x - PIVOT_PX[0], y - PIVOT_PX[1]
    forward = dx * along[0] + dy * along[1]
    nearest = np.clip(forward, 0.0, LEVER_PX)
    from_stick = np.hypot(dx - nearest * along[0], dy - nearest * along[1])
    from_dot = np.hypot(dx - LEVER_PX * along[0], dy - LEVER_PX * along[1])
    for distance, radius, colour in ((from_stick, 4.0, STICK), (from_dot, 9.0, DOT), (np.hypot(dx, dy), 9.0, DISC)):
        cover = np.clip(radius + 0.5 - distance, 0.0, 1.0)[..., None]
        picture += cover * (np.array(colour, dtype=float) - picture)
    return picture
