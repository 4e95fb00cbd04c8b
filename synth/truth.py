"""What really happened, worked out before a single frame is drawn, and written where the session is not."""

from __future__ import annotations

import csv
import json
import math
import platform
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anglecam.neck import reach
from synth.camera import DISTANCE, Pinhole, aim
from synth.clip import frame_rate
from synth.command import command_rows
from synth.mesh import build, mouth_centre, neutral_rocker
from synth.motion import drive_from_rows, move
from synth.spec import Free, Recording, Rig, Spec, SpecError

Floats = NDArray[np.float64]

COLUMNS = ("frame", "time_s", "true_time_s", "angle_deg", "mouth_x_px", "mouth_y_px", "pivot_x_px", "pivot_y_px")


@dataclass(frozen=True)
class Take:
    """The truth of one recording."""

    recording: Recording
    command: Floats | None
    """Rows (time_s, command_deg), or ``None``."""
    times: Floats
    """Of the frames, s."""
    angles: Floats
    """θ at those times, rad."""


@dataclass(frozen=True)
class View:
    """The camera, and the mouth that it looks at."""

    pinhole: Pinhole
    mouth: Floats
    """Centre of the lips at neutral, (x, y) in the plane of motion, m."""


def view(spec: Spec) -> View:
    """Aim the camera so that the lever measures what the spec asks for."""
    mouth = mouth_centre(build(spec.rig, spec.seed), DISTANCE)
    lever = float(np.hypot(*mouth))
    mirrored = spec.rig.facing == "left"
    return View(aim(spec.camera.size, spec.rig.lever_px, lever, spec.rig.pivot_px, mirrored), mouth)


def perform(spec: Spec, seen: View) -> list[Take]:
    """Move the rig through every recording.

    Parameters
    ----------
    spec : Spec
        The whole session.
    seen : View
        The camera.

    Returns
    -------
    list of Take
        In the order of the spec.

    Raises
    ------
    SpecError
        If a motion leaves the range in which the linkage closes, or the mouth leaves the picture.
    """
    seeds = np.random.SeedSequence(spec.seed).spawn(len(spec.recordings))
    takes = []
    for number, (recording, seed) in enumerate(zip(spec.recordings, seeds, strict=True)):
        rows = command_rows(recording, seed.spawn(1)[0])
        free = recording.command if isinstance(recording.command, Free) else None
        start = math.radians(free.initial_angle_deg) if free else 0.0
        drive = drive_from_rows(rows, spec.effects)
        end = recording.duration_s
        let_go = min(free.rest_s, end) if free else 0.0
        motion = move(spec.plant, spec.effects, drive, end, start, let_go)
        times = np.arange(max(1, round(end * frame_rate(spec.camera)))) / float(frame_rate(spec.camera))
        angles = motion.angle(times)
        _within_reach(angles, spec.rig, f"recordings.{number}.command")
        _within_picture(marks(seen, angles), spec, f"recordings.{number}.command")
        takes.append(Take(recording, rows, times, angles))
    return takes


def marks(seen: View, angles: Floats) -> Floats:
    """Project mouth and pivot: columns mouth x, mouth y, pivot x, pivot y, px."""
    x, y = seen.mouth
    turned = np.stack(
        [x * np.cos(angles) - y * np.sin(angles), x * np.sin(angles) + y * np.cos(angles), np.zeros(len(angles))],
        axis=1,
    )
    return np.hstack([seen.pinhole.project(turned), seen.pinhole.project(np.zeros((len(angles), 3)))])


def write_truth(folder: Path, spec: Spec, seen: View, takes: list[Take]) -> None:
    """Write ``NAME.truth.csv`` for every take, and ``truth.json``.

    Parameters
    ----------
    folder : Path
        Existing, and apart from the session.
    spec : Spec
        The whole session.
    seen : View
        The camera.
    takes : list of Take
        The motions.
    """
    for take in takes:
        with (folder / f"{take.recording.name}.truth.csv").open("w", encoding="utf-8", newline="") as stream:
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerow(COLUMNS)
            for frame, (time, angle, pixels) in enumerate(
                zip(take.times, np.degrees(take.angles), marks(seen, take.angles), strict=True)
            ):
                # an ideal camera opens for an instant, at the very time that the file states
                writer.writerow(
                    [frame, f"{time:.9f}", f"{time:.9f}", f"{angle:.9f}", *(f"{pixel:.6f}" for pixel in pixels)]
                )
    (folder / "truth.json").write_text(json.dumps(_record(spec, seen), indent=1) + "\n", encoding="utf-8")


def _record(spec: Spec, seen: View) -> dict[str, Any]:
    return {
        "seed": spec.seed,
        "plant": spec.plant.model_dump(),
        "effects": spec.effects.model_dump(exclude_none=True),
        "camera": {**spec.camera.model_dump(), "distance_m": DISTANCE, **asdict(seen.pinhole)},
        "rig": spec.rig.model_dump(),
        "mouth_m": seen.mouth.tolist(),
        "recordings": {
            recording.name: {"duration_s": recording.duration_s, "command": recording.command.model_dump()}
            for recording in spec.recordings
        },
        "declare": spec.declare,
        "versions": {
            "python": platform.python_version(),
            **{name: version(name) for name in ("anglecam", "numpy", "scipy", "trimesh", "pyrender", "av")},
        },
    }


def _within_reach(angles: Floats, rig: Rig, key: str) -> None:
    low, high = reach(rig.linkage)
    neutral = neutral_rocker(rig.linkage)
    if angles.max() >= neutral - low or angles.min() <= neutral - high:
        reached, limits = np.degrees([angles.min(), angles.max()]), np.degrees([neutral - high, neutral - low])
        raise SpecError(
            f"{key}: the head would move from {reached[0]:.1f}° to {reached[1]:.1f}°, "
            f"the linkage closes from {limits[0]:.1f}° to {limits[1]:.1f}° only"
        )


def _within_picture(pixels: Floats, spec: Spec, key: str) -> None:
    width, height = spec.camera.size
    x, y = pixels[:, 0], pixels[:, 1]
    if x.min() < 0 or y.min() < 0 or x.max() > width - 1 or y.max() > height - 1:
        raise SpecError(
            f"{key}: the mouth would leave the picture of {width} × {height} px "
            f"(x {x.min():.0f} to {x.max():.0f}, y {y.min():.0f} to {y.max():.0f}); see rig.lever_px and rig.pivot_px"
        )
