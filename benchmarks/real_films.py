"""Measures real films that nobody here made, each beside a plain tracker, and against what is known of them.

    .venv/bin/python -m benchmarks.real_films FOLDER [--only WORD ...]

FOLDER (or the environment variable ANGLECAM_REAL) holds ``films/NAME`` and ``pendulum-red-ball``; the films are not
part of this project. Every film is measured without a rig file first and, where that is no success, with the one hint
of the table. Both angles are compared at equal time stamps, after their medians are subtracted. The scale is that of
anglecam's angle over the tracker's: on a shallow arc neither knows the pivot well.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import date
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from anglecam.data.series import AngleSeries
from anglecam.errors import AnglecamError
from anglecam.io.rig import Rig
from anglecam.workflow.clip import measure_source, open_source
from benchmarks.real.trackers import Tracked, blob, frames, gear, polar, thread

SAME_S = 0.002
"""Time stamps closer than this are one frame's; containers round to a millisecond."""
ENCODER_LATE_S = 1.92
"""Time in the film at which the pendubot's log begins, s: with it the measured angle differs least. A coarse tracker of
the darkest place on a circle gave 1.96."""


@dataclass(frozen=True)
class RealFilm:
    """A film, how to track it plainly, and what is known of it."""

    path: str
    track: Callable[[Path], Tracked]
    hint: dict[str, Any] = field(default_factory=dict)
    known: str = ""
    periodic: bool = True


def _redder(image: np.ndarray) -> np.ndarray:
    b, g, r = (image[..., k].astype(int) for k in range(3))
    return r - np.maximum(b, g) > 120


def _bauble(image: np.ndarray) -> np.ndarray:
    b, g, r = (image[..., k].astype(int) for k in range(3))
    return r - np.maximum(b, g) > 60


def _bluer(image: np.ndarray) -> np.ndarray:
    return image[..., 0].astype(int) - image[..., 2] > 10


def _yellow_left(image: np.ndarray) -> np.ndarray:
    """Return the gilded ball of the left pendulum."""
    b, g, r = (image[..., k].astype(int) for k in range(3))
    chosen = (np.minimum(r, g) - b > 40) & (np.indices(b.shape)[0] > 240)
    chosen[:, 440:] = False
    return chosen


def _red_below(image: np.ndarray) -> np.ndarray:
    """Return the dot on the bob, which hangs below the red things on the shelf."""
    chosen = _redder(image)
    chosen[:240] = False
    return chosen


def _greener(image: np.ndarray) -> np.ndarray:
    """Return the only green sector of the wheel."""
    b, g, r = (image[..., k].astype(int) for k in range(3))
    return g - np.maximum(b, r) > 20


def _turns_steadily(path: Path, rate_deg_s: float) -> Tracked:
    times = np.array([time for time, _ in frames(path)])
    return times, rate_deg_s * times


def _shoulder(path: Path) -> Tracked:
    """Return the encoder of the driven link, at the times of the frames within its log."""
    log = np.genfromtxt(path.with_name("encoder.csv"), delimiter=",", names=True)
    times = np.array([time for time, _ in frames(path)])
    at = times - ENCODER_LATE_S
    angle = np.interp(at, log["time_s"], log["shoulder_deg"])
    return times, np.where((at >= log["time_s"][0]) & (at <= log["time_s"][-1]), angle, np.nan)


FILMS = {
    "red ball": RealFilm(
        "pendulum-red-ball/esempio.avi",
        lambda path: blob(path, _redder, (650.0, -709.0)),
        {"mouth": {"rgb": [200, 40, 30]}},
        "T 1.84 to 1.91 s",
    ),
    "bauble": RealFilm("films/bauble/pendulum.mp4", lambda path: blob(path, _bauble), {}, "T 2.629 s, L 1.70 m"),
    "blue ball": RealFilm(
        "films/blue-ball/film2_vga.mp4",
        lambda path: blob(path, _bluer, (265.0, -620.0)),
        {"mouth": {"rgb": [40, 90, 150]}},
        "T 1.601 s, L 0.636 m",
    ),
    "stopwatch": RealFilm(
        "films/stopwatch/video1.mp4",
        lambda path: thread(path, (570.0, 107.0), (150.0, 470.0), 38.0),
        {"pivot": {"near": [570, 107]}},
        "T 1.333 s",
    ),
    "clock pendula": RealFilm(
        "films/clock-pendula/pendula.mp4",
        lambda path: blob(path, _yellow_left, (375.0, 14.0)),
        {"pivot": {"near": [375, 14]}},
        "T 1.142 s",
    ),
    "stepper hand": RealFilm(
        "films/stepper-hand/moving_timer.mp4",
        lambda path: polar(path, (511.0, 741.0), (190.0, 420.0), handheld=False, subtract=True),
        {"pivot": {"near": [511, 741]}},
        periodic=False,
    ),
    "servo, 60 Hz": RealFilm(
        "films/servo-60fps/servo.mp4",
        lambda path: polar(path, (389.0, 567.0), (20.0, 85.0), handheld=True, subtract=True),
        {"pivot": {"near": [389, 567]}},
        periodic=False,
    ),
    "servo on a desk": RealFilm(
        "films/servo-desk/servo.mp4",
        lambda path: polar(path, (158.0, 231.0), (12.0, 75.0), handheld=True, subtract=True),
        {"pivot": {"near": [158, 231]}},
        periodic=False,
    ),
    "wooden gear": RealFilm(
        "films/wooden-gears/WorkingGears.MOV",
        lambda path: gear(path, (1236.0, 464.0), (428.0, 375.0), 13.0),
        {"pivot": {"near": [670, 1193]}},
        periodic=False,
    ),
    "lab pendulum": RealFilm(
        "films/lab-pendulum/lab_pendulum_20fps.avi", lambda path: blob(path, _red_below), {}, "T 0.773 s"
    ),
    "turntable": RealFilm(
        "films/turntable/turntable.mp4",
        lambda path: _turns_steadily(path, -200.0),
        {"pivot": {"near": [668, 553]}},
        "33 1/3 turns a minute, clockwise",
        periodic=False,
    ),
    "fivefold wheel": RealFilm(
        "films/wheel-fivefold/wheel_fivefold.mp4",
        lambda path: blob(path, _greener, (75.0, 88.5)),
        {},
        "706.8° clockwise",
        periodic=False,
    ),
    "pendubot": RealFilm(
        "films/pendubot/pendubot.m4v", _shoulder, {"pivot": {"near": [307, 476]}}, "encoders", periodic=False
    ),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", default=os.environ.get("ANGLECAM_REAL"))
    parser.add_argument("--only", nargs="*", default=[], help="films whose name contains one of these words")
    arguments = parser.parse_args()
    if arguments.folder is None:
        parser.error("give the folder of the films, or set ANGLECAM_REAL")
    print(f"anglecam {version('anglecam')}, {date.today():%d %B %Y}\n")
    print("| film | given | ok rows | RMS difference ° | scale | the same, scaled ° | sigma ° | period s | known |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for name, film in FILMS.items():
        if arguments.only and not any(word in name for word in arguments.only):
            continue
        path = Path(arguments.folder) / film.path
        tracked = film.track(path)
        for hint in ({}, film.hint) if film.hint else ({},):
            row, success = cells(path, hint, tracked, film)
            print(f"| {name} | {hint or 'nothing'} | {row} | {film.known} |", flush=True)
            if success:
                break


@dataclass(frozen=True)
class Compared:
    """One measurement beside the tracker; the differences are NaN where no frame has both."""

    ok: int
    rows: int
    difference_deg: float
    """RMS, the medians subtracted."""
    scale: float
    """anglecam's angle over the tracker's."""
    scaled_deg: float
    """RMS difference after the tracker's angle is multiplied by the scale."""
    over_sigma: float
    """RMS of that difference over sigma."""
    sigma_deg: float
    """Median."""
    period_s: float


def cells(path: Path, hint: dict[str, Any], tracked: Tracked, film: RealFilm) -> tuple[str, bool]:
    """Measure a film; return the cells of its row, and whether it was a success."""
    try:
        measured = measure_source(open_source(path, Rig.model_validate(hint)))
    except AnglecamError as problem:
        return f"{str(problem).replace(f'{path}: ', '')} | | | | | ", False
    found = compared(measured.series, tracked)
    shown = [
        f"{found.ok}/{found.rows}",
        f"{found.difference_deg:.3f}",
        f"{found.scale:.3f}",
        f"{found.scaled_deg:.3f}",
        f"{found.sigma_deg:.3f}",
        f"{found.period_s:.4f}" if film.periodic else "",
    ]
    return " | ".join(shown), measured.doubt is None


def compared(series: AngleSeries, tracked: Tracked) -> Compared:
    """Compare angles with a tracker's at equal time stamps."""
    times, angle = tracked
    # FFmpeg states times of reordered frames in AVI late by the decoder's delay; each count starts at its first frame.
    times, own = times - times[0], series.time - series.time[0]
    nearest = np.abs(times[None, :] - own[:, None]).argmin(axis=1)
    both = series.ok & (np.abs(times[nearest] - own) < SAME_S) & np.isfinite(angle[nearest])
    found, other = np.degrees(series.angle[both]), angle[nearest][both]
    found, other = found - np.median(found), other - np.median(other)
    scale = float(found @ other / (other @ other))
    scaled = found - scale * other
    return Compared(
        int(series.ok.sum()),
        len(series.ok),
        float(np.sqrt(((found - other) ** 2).mean())),
        scale,
        float(np.std(scaled)),
        float(np.sqrt((((scaled - scaled.mean()) / np.degrees(series.sigma[both])) ** 2).mean())),
        float(np.degrees(np.median(series.sigma[series.ok]))),
        _period(series.time[series.ok], series.angle[series.ok]),
    )


def _period(time: np.ndarray, angle: np.ndarray) -> float:
    """Return the mean time between upward crossings of the middle, s; crossings closer than 0.3 s are noise."""
    swing = angle - (np.quantile(angle, 0.9) + np.quantile(angle, 0.1)) / 2.0
    up = np.flatnonzero((swing[:-1] < 0.0) & (swing[1:] >= 0.0))
    cross = time[up] - swing[up] * (time[up + 1] - time[up]) / (swing[up + 1] - swing[up])
    cross = cross[np.insert(np.diff(cross) > 0.3, 0, True)] if len(cross) else cross
    return float((cross[-1] - cross[0]) / (len(cross) - 1)) if len(cross) > 1 else float("nan")


if __name__ == "__main__":
    main()
