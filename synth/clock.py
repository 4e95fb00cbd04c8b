"""The true time of each frame of a clip, and the time stamp that the file gives it.

A good camera takes frame k at k/fps and stamps it k/fps. A camera with a fast clock stamps k/fps too but takes the
frame sooner; a wrong declared rate changes the stamps; a variable rate takes frames at uneven intervals; a dropped
frame leaves a gap; a duplicate repeats the previous picture under a new time stamp.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from synth.effects.clock_scale import ClockScale
from synth.spec import Camera, Effects

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FINE = Fraction(1, 90_000)
"""Time unit of an MP4 with a variable rate, s."""
MATROSKA = Fraction(1, 1000)
"""Time unit of every MKV, s."""


@dataclass(frozen=True)
class Timetable:
    """The frames of one clip, in file order."""

    unit: Fraction
    """Unit of the file's time stamps, s."""
    stamps: Ints
    """Time stamps in the file, in units of `unit`."""
    taken: Floats
    """True time of the middle of the exposure of the middle row, s; a duplicate has that of the picture it repeats."""
    repeats: NDArray[np.bool_]
    """Whether the frame repeats the previous picture."""

    @property
    def times(self) -> Floats:
        """Return the time stamps in the file, s."""
        return np.asarray(self.stamps * float(self.unit))


def timetable(camera: Camera, effects: Effects, duration: float, seed: np.random.SeedSequence) -> Timetable:
    """Work out the frames of one recording.

    Parameters
    ----------
    camera : Camera
        Rate, container, dropped and duplicated frames, jitter.
    effects : Effects
        Only ``clock_scale`` acts here.
    duration : float
        Duration of the recording by the camera's clock, s.
    seed : numpy.random.SeedSequence
        Source of the random numbers.

    Returns
    -------
    Timetable
        It begins with a frame at time 0 that is neither dropped nor a duplicate.
    """
    rng = np.random.default_rng(seed)
    count = max(1, round(duration * as_fraction(camera.fps)))
    uneven = 1 + camera.interval_jitter * rng.uniform(-1.0, 1.0, count - 1)
    since_start = np.concatenate([[0.0], np.cumsum(uneven)]) if camera.interval_jitter else np.arange(float(count))
    fate = rng.uniform(size=(2, count))
    fate[:, 0] = 1.0  # the first frame is never dropped and never a duplicate
    kept = fate[0] >= camera.dropped
    repeats = (fate[1] < camera.duplicated)[kept]

    unit, interval = _grid(camera)
    stamps = np.rint(since_start * float(interval / unit)).astype(np.int64)[kept]
    clock = effects.get(ClockScale)
    scale = clock.scale if clock else 1.0
    taken = since_start[kept] / (float(as_fraction(camera.fps)) * scale)
    shown = np.maximum.accumulate(np.where(repeats, 0, np.arange(len(repeats))))
    return Timetable(unit, stamps, taken[shown], repeats)


def as_fraction(fps: float) -> Fraction:
    """Return frames per second as files state them: 29.97 is 30000/1001."""
    whole = Fraction(fps).limit_denominator(1001)
    ntsc = Fraction(round(fps * 1.001) * 1000, 1001)
    return ntsc if abs(float(ntsc) - fps) < 0.005 and whole.denominator != 1 else whole


def _grid(camera: Camera) -> tuple[Fraction, Fraction]:
    """Return the unit of the file's time stamps and the frame interval that the file states, s."""
    interval = 1 / as_fraction(camera.declared_fps or camera.fps)
    if camera.suffix == "mkv":
        return MATROSKA, interval
    return (FINE if camera.interval_jitter else interval), interval
