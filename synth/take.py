"""Plans one recording before anything is drawn: the motion, the frame times, and the exposure of each frame.

Every random number comes from the seed, the number of the recording and the number of its purpose, so that recordings
do not depend on each other.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anglecam.neck import reach
from synth.camera import Pinhole, aim
from synth.clock import Timetable, timetable
from synth.effects.pivot_offset import PivotOffset
from synth.effects.rolling_shutter import RollingShutter
from synth.errors import SpecError
from synth.exposure import Shutter, instants
from synth.mechanism import build, mouth_centre, neutral_rocker
from synth.mechanism.linkage import FACE_Z
from synth.motion import Motion, command_rows, move
from synth.sensor import flicker
from synth.shake import Unrest, unrest
from synth.spec import Recording, Rig, Spec

Floats = NDArray[np.float64]

COMMAND, NOISE, CLOCK, SHAKE = range(4)
"""Purposes of a recording's random numbers, part of their seeds."""
STEP_PX = {"draft": 1.0, "standard": 0.75, "metrology": 0.25}
"""Largest distance that the mark moves between two instants of a frame, px, by quality."""
AFTERWARDS_S = 0.5
"""Motion is computed this much beyond the last frame's time, s: its exposure ends and its lower rows are later."""
PROBES = 9
"""Times within a frame between which the mark's displacement is summed."""


@dataclass(frozen=True)
class View:
    """The camera, and the position of the mouth and of the pivot's mark."""

    pinhole: Pinhole
    mouth: Floats
    """Centre of the lips at neutral, (x, y) in the plane of motion, m."""
    mark_offset: tuple[float, float]
    """Offset of the mark on the shaft from the axis of rotation, m."""


@dataclass(frozen=True)
class Exposure:
    """Everything a worker needs to draw one frame."""

    frame: int
    """Number of the frame in the file; part of the noise's seed."""
    times: Floats
    """(n,), times of the instants, s."""
    weights: Floats
    """(n, rows) or (n, 1), weights of the instants."""
    angles: Floats
    """(n,), angle of the head, rad."""
    appendage: Floats
    """(n,), angle of the appendage from the head, rad."""
    shifts: Floats
    """(n, 2), shift of the picture, px."""
    rolls: Floats
    """(n,), rotation of the picture, rad."""
    lamp: NDArray[np.bool_]
    """(n,), whether the sync lamp is on."""
    gain: Floats
    """Strength of the light, (rows,) or (1,)."""


@dataclass(frozen=True)
class Take:
    """The truth of one recording."""

    number: int
    recording: Recording
    command: Floats | None
    """Rows (time_s, command_deg), or ``None``."""
    table: Timetable
    motion: Motion
    unrest: Unrest

    @property
    def first_change(self) -> float:
        """Return the time at which the command first changes, s; infinite if it never changes."""
        if self.command is None:
            return math.inf
        changes = np.flatnonzero(np.diff(self.command[:, 1])) + 1
        return float(self.command[changes[0], 0]) if len(changes) else math.inf


def seed_of(spec: Spec, recording: int, purpose: int, *more: int) -> np.random.SeedSequence:
    """Return the seed for one purpose in one recording, the same as if spawned child by child from the spec's seed."""
    return np.random.SeedSequence(spec.seed, spawn_key=(recording, purpose, *more))


def view(spec: Spec) -> View:
    """Aim the camera so that the lever appears with the spec's length."""
    mouth = mouth_centre(build(spec), spec.camera.distance_m)
    pinhole = aim(spec, float(np.hypot(*mouth)))
    offset = (0.0, 0.0)
    if moved := spec.effects.get(PivotOffset):
        metres = (pinhole.distance_m - FACE_Z) / pinhole.focal_px
        offset = ((-1 if pinhole.mirrored else 1) * moved.dx_px * metres, -moved.dy_px * metres)
    return View(pinhole, mouth, offset)


def perform(spec: Spec, seen: View, names: Collection[str] | None = None) -> list[Take]:
    """Move the rig through the recordings.

    Parameters
    ----------
    spec : Spec
        The whole session.
    seen : View
        The camera.
    names : collection of str, optional
        Names of the recordings; all by default. A recording does not depend on which others are performed.

    Returns
    -------
    list of Take
        In the order of the spec.

    Raises
    ------
    SpecError
        If a motion leaves the range in which the linkage closes, or the mouth leaves the picture.
    """
    takes = []
    for number, recording in enumerate(spec.recordings):
        if names is not None and recording.name not in names:
            continue
        key = f"recordings.{number}.command"
        rows = command_rows(recording, seed_of(spec, number, COMMAND))
        table = timetable(spec.camera, spec.effects, recording.duration_s, seed_of(spec, number, CLOCK))
        try:
            motion = move(spec, recording, rows, float(table.taken[-1]) + AFTERWARDS_S)
        except ValueError as error:
            raise SpecError(f"{key}: {error}") from error
        moving = unrest(spec.camera, spec.effects, seed_of(spec, number, SHAKE))
        take = Take(number, recording, rows, table, motion, moving)
        if spec.rig.neck == "linkage":
            _within_reach(motion.angle(table.taken), spec.rig, key)
        _within_picture(marks(seen, take)[:, :2], spec, key)
        takes.append(take)
    return takes


def marks(seen: View, take: Take) -> Floats:
    """Project mouth, centre of rotation and pivot mark at the middle of every frame's exposure.

    Returns
    -------
    ndarray
        (frames, 6): x and y of each, px.
    """
    times = take.table.taken
    angles = take.motion.angle(times)
    x, y = seen.mouth
    mouth = np.stack([x * np.cos(angles) - y * np.sin(angles), x * np.sin(angles) + y * np.cos(angles)], axis=1)
    pixels = []
    for point, shift, roll in zip(mouth, take.unrest.shift(times), take.unrest.roll(times), strict=True):
        points = [[*point, 0.0], [0.0, 0.0, 0.0], [*seen.mark_offset, FACE_Z]]
        pixels.append(seen.pinhole.shaken(float(shift[0]), float(shift[1]), float(roll)).project(points).ravel())
    return np.array(pixels)


def plan(spec: Spec, seen: View, take: Take, frame: int) -> Exposure:
    """Plan the exposure of one frame.

    Parameters
    ----------
    spec : Spec
        The whole session.
    seen : View
        The camera.
    take : Take
        The recording.
    frame : int
        Number of the frame in the file.

    Returns
    -------
    Exposure
        With a single instant if the mark hardly moves.
    """
    rolling = spec.effects.get(RollingShutter)
    shutter = Shutter(spec.camera.exposure_s, rolling.row_time_s if rolling else 0.0, spec.camera.size[1])
    taken = float(take.table.taken[frame])
    probes = taken + shutter.span_s * np.linspace(-0.5, 0.5, PROBES)
    turned = np.abs(np.diff(take.motion.angle(probes) + take.unrest.roll(probes))).sum()
    shaken = np.hypot(*np.diff(take.unrest.shift(probes), axis=0).T).sum()
    path = spec.rig.lever_px * float(turned) + float(shaken)
    planned = instants(shutter, taken, path, STEP_PX[spec.render.quality])
    return Exposure(
        frame=frame,
        times=planned.times,
        weights=planned.weights,
        angles=take.motion.angle(planned.times),
        appendage=take.motion.appendage(planned.times),
        shifts=take.unrest.shift(planned.times),
        rolls=take.unrest.roll(planned.times),
        lamp=planned.times >= take.first_change,
        gain=flicker(spec.camera, shutter, taken),
    )


def _within_reach(angles: Floats, rig: Rig, key: str) -> None:
    low, high = reach(rig.linkage)
    neutral = neutral_rocker(rig.linkage)
    if angles.max() >= neutral - low or angles.min() <= neutral - high:
        reached, limits = np.degrees([angles.min(), angles.max()]), np.degrees([neutral - high, neutral - low])
        raise SpecError(
            f"{key}: the head would move from {reached[0]:.1f}° to {reached[1]:.1f}°, "
            f"the linkage closes from {limits[0]:.1f}° to {limits[1]:.1f}° only"
        )


def _within_picture(mouth: Floats, spec: Spec, key: str) -> None:
    width, height = spec.camera.size
    x, y = mouth.T
    if x.min() < 0 or y.min() < 0 or x.max() > width - 1 or y.max() > height - 1:
        raise SpecError(
            f"{key}: the mouth would leave the picture of {width} × {height} px "
            f"(x {x.min():.0f} to {x.max():.0f}, y {y.min():.0f} to {y.max():.0f}); see rig.lever_px and rig.pivot_px"
        )
