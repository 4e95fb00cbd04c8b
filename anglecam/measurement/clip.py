"""From a clip to the angle in every frame: coarse by the mouth's place, fine by the whole head.

`anglecam.measurement.mark_pass` finds mouth and pivot. Where more of the head than the mouth is rigid and has edges,
`anglecam.measurement.registration_pass` reads on and finds the turn from all of it; the more certain of the two is taken.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from anglecam.camera.shutter import measurement_time
from anglecam.data.camera_evidence import CameraEvidence
from anglecam.data.command import Command
from anglecam.data.series import OK, AngleSeries
from anglecam.data.typing import Floats
from anglecam.io.rig import Rig
from anglecam.io.session import recording_name
from anglecam.measurement.angles import Angles, coarse_angles, turns
from anglecam.measurement.clock_sync import DARK, note_on, offset_of, on_clip_clock, see_lamp
from anglecam.measurement.detections import Detections
from anglecam.measurement.fine_angles import fine_angles
from anglecam.measurement.mark_pass import detect_mark
from anglecam.measurement.registration_pass import Registered, Start, register_clip
from anglecam.measurement.rigid_body_pass import detect_rigid_body
from anglecam.measurement.series import series_of_angles, why_zero_is_elsewhere
from anglecam.video.film import Film
from anglecam.vision.mark.outline_turn import outline_turn

_CARRIED_PX = 1.0
"""How far from where the head carries it a mouth may seem to be that is smeared and not hidden."""
_MOVING = 5.0
"""Standard uncertainties by which the angle must change on both sides of a repeated frame for it to be one."""


@dataclass(frozen=True)
class Measurement:
    """What was measured in a clip, and how."""

    series: AngleSeries
    detections: Detections
    """The coarse pass."""
    angles: Angles
    """The measured frames, and what their uncertainties are made of."""
    why_coarse: str | None
    """Why the angles are the mouth's own; ``None`` where they are the whole head's."""
    zero: str | None
    """Where zero is not where it should be, and why."""
    clock: str | None
    """Where the lamp shows that the command's clock is not the clip's, or does not show it."""

    @property
    def pivot(self) -> str:
        """Where the pivot's place comes from."""
        return self.angles.pivot.source

    @property
    def by(self) -> str:
        """What the angles were read off."""
        if self.why_coarse is None:
            return "whole head"
        return "mouth" if self.detections.head is None else "head's key frames"

    @property
    def truncated(self) -> str | None:
        """What could not be read of a file that ends too early."""
        return self.detections.truncated

    @property
    def notes(self) -> tuple[str, ...]:
        """What the user should know, a line each."""
        coarse = () if self.why_coarse is None else (f"measured by the {self.by} alone: {self.why_coarse}",)
        return (*self.detections.notes, *coarse, *(note for note in (self.zero, self.clock) if note is not None))

    @property
    def contours_px(self) -> tuple[NDArray[np.int32] | None, ...]:
        """Each frame's (k, 2) outline of the mouth, where one was found."""
        return tuple(None if r is None else r.contour_px for r in self.detections.regions)


def measure_clip(
    film: Film, rig: Rig, command: Command | None = None, *, progress: Callable[[int, int], None] | None = None
) -> Measurement:
    """Measure the nodding angle in every frame of a clip.

    Parameters
    ----------
    film : Film
        The clip.
    rig : Rig
        What is declared about mouth, pivot, direction, neutral and camera.
    command : Command, optional
        What was commanded; its first change ends the rest that defines neutral. Where the rig declares a lamp, it is
        dated by that.
    progress : callable, optional
        Called with (frames done, frames in all) after each frame.

    Returns
    -------
    Measurement
        The series has a row for every frame of the file, measured or not.

    Raises
    ------
    InputError
        Where the file cannot be read, or no frame of it can be measured: one line with file, count and cause.
    """
    changes = command is not None and command.first_change() is not None
    lamp = see_lamp(film, rig) if changes else None
    offset = offset_of(command, lamp)
    command = on_clip_clock(command, offset)
    seen = detect_mark(film, rig, progress)
    ok = np.array([s == OK for s in seen.status])
    row = _mouth_rows(seen)
    time = measurement_time(seen.time, row, seen.size[1], rig.camera.row_time_s)
    angles = coarse_angles(seen, ok, time, rig, command)
    why_coarse: str | None = "the mouth does not move"
    if seen.moves:
        start = _start(seen, ok, time, row, angles, rig)
        registered = register_clip(film, start, seen.lens, progress)
        why_coarse = registered if isinstance(registered, str) else None
        if isinstance(registered, Registered):
            registered = replace(registered, turn=registered.turn - _rolls(seen))
            start = replace(start, turn=start.turn - _rolls(seen))
            found = np.isfinite(registered.turn)
            ok = ok | (found & _carried_along(seen, start, registered, angles))
            row = np.where(found, registered.row, row)
            time = measurement_time(seen.time, row, seen.size[1], rig.camera.row_time_s)
            angles = coarse_angles(seen, ok, time, rig, command)
            filmed = seen.in_picture(_among(ok, angles.mark_px))[ok]
            angles = fine_angles(angles, registered, np.flatnonzero(ok), filmed, time[ok], rig, command)
        elif _only_the_path_tells(seen, rig):
            # a pivot that only a mouth's path tells is far less sure than one that the whole head turns about
            head = detect_rigid_body(film, rig)
            if isinstance(head, Detections):
                rigid = np.array([s == OK for s in head.status])
                other = coarse_angles(head, rigid, head.time, rig, command)
                if (other.sigma**2).mean() < (angles.sigma**2).mean():
                    seen, ok, time, angles = head, rigid, head.time, other
    series = _series(film.path, rig, time, seen, ok, angles, lamp)
    zero = why_zero_is_elsewhere(rig, command, time[ok])
    dark = changes and lamp is None and rig.sync.lamp is not None
    return Measurement(series, seen, angles, why_coarse, zero, DARK if dark else note_on(offset))


def _only_the_path_tells(seen: Detections, rig: Rig) -> bool:
    """Tell whether the pivot is where the mouth's path has its centre, and a rigid head could be followed instead."""
    followable = seen.head is None and seen.shakes is None and seen.lens.is_identity
    return followable and seen.marker is None and rig.pivot.near is None


def _among(ok: NDArray[np.bool_], places_px: Floats) -> Floats:
    """Lay the places of the measured frames among all the clip's frames."""
    among = np.full((len(ok), 2), np.nan)
    among[ok] = places_px
    return among


def _rolls(seen: Detections) -> Floats:
    """Return how far the camera rolled in each frame, rad."""
    return np.zeros(len(seen.time)) if seen.shakes is None else np.array([move.roll for move in seen.shakes])


def _mouth_rows(seen: Detections) -> Floats:
    """Return the rows of the picture in which the mouth was seen."""
    nowhere = np.full(2, np.nan)
    places = np.array([nowhere if r is None else r.centre_px for r in seen.regions])
    if seen.head is not None:
        places = np.where(np.isfinite(seen.head.turn)[:, None], seen.lens.rectify(seen.head.centre_px), nowhere)
    return np.asarray(seen.in_picture(places)[:, 1])


def _carried_along(seen: Detections, start: Start, registered: Registered, angles: Angles) -> NDArray[np.bool_]:
    """Tell in which of the doubtful frames the mouth is where the head carries it: all of it is seen, but smeared."""
    off = registered.turn - start.turn - start.turn_per_row * (registered.row - start.row)
    sure, lever = np.isfinite(start.sigma) & np.isfinite(off), float(np.median(angles.lever_px))
    nowhere = np.full(2, np.nan)
    places = np.array([nowhere if r is None else r.centre_px for r in seen.regions])
    outward = np.hypot(*(places - seen.pivot.centre_px).T) - lever
    along = (off - np.median(off[sure])) * lever
    with np.errstate(invalid="ignore"):
        return np.asarray(seen.smeared & (np.hypot(along, outward) < _CARRIED_PX))


def _start(seen: Detections, ok: NDArray[np.bool_], time: Floats, row: Floats, angles: Angles, rig: Rig) -> Start:
    """Lay the coarse turns among all the clip's frames."""
    n = len(time)
    turn, sigma, speed = np.full(n, np.nan), np.full(n, np.nan), np.zeros(n)
    turn[ok], sigma[ok] = turns(angles, rig), angles.sigma
    guessed = np.flatnonzero(seen.smeared)
    if len(guessed):
        arm = np.array([r.centre_px for i in guessed if (r := seen.regions[i])]) - seen.pivot.centre_px
        line = np.arctan2(-arm[:, 1], arm[:, 0] if rig.facing == "right" else -arm[:, 0])
        near = line - np.median(angles.line)
        near -= 2.0 * np.pi * np.round(near / (2.0 * np.pi))
        turn[guessed] = near if rig.facing == "right" else -near
    known = np.isfinite(turn)
    if rig.camera.row_time_s is not None and known.sum() > 1:
        speed[known] = np.gradient(turn[known], time[known])
    pivots, wander = np.broadcast_to(seen.pivot.centre_px, (n, 2)), None
    if seen.shakes is not None:
        pivots = seen.lens.rectify(seen.in_picture(pivots))
        filmed = seen.lens.distort(seen.pivot.centre_px)
        wander = np.array([move.place_covariance(filmed) for move in seen.shakes])
        turn = turn + _rolls(seen)
    return Start(
        turn=turn,
        sigma=sigma,
        pivot=seen.pivot,
        pivots_px=pivots,
        wander_px2=wander,
        turn_per_row=speed * (rig.camera.row_time_s or 0.0),
        row=row,
    )


def _series(
    path: Path,
    rig: Rig,
    time: Floats,
    seen: Detections,
    ok: NDArray[np.bool_],
    angles: Angles,
    lamp: tuple[float, float] | None,
) -> AngleSeries:
    """Lay the measured frames among all the clip's frames, less the duplicates."""
    status = [OK if k else s for k, s in zip(ok, seen.status, strict=True)]
    lines, sigmas = np.full((2, len(time)), np.nan)
    lines[ok], sigmas[ok] = angles.line, angles.sigma
    for i in _duplicates(lines, sigmas, seen.repeated):
        status[i] = "duplicate"
    mouths = seen.in_picture(_among(ok, angles.mark_px))
    pivots = seen.in_picture(np.broadcast_to(angles.pivot.centre_px, (len(time), 2)))
    from_mark = seen.head is None and angles.registered is None
    evidence = CameraEvidence(
        picture_px=seen.size,
        marker_px=_marker(seen),
        from_mark=from_mark,
        outline_turn=_outline_turn(seen, ok) if from_mark else None,
        lamp_s=lamp,
    )
    return series_of_angles(recording_name(path), time, status, ok, angles, mouths, pivots, rig, evidence)


def _outline_turn(seen: Detections, ok: NDArray[np.bool_]) -> tuple[float, float] | None:
    regions = [seen.regions[i] for i in np.flatnonzero(ok)]
    whole = [region for region in regions if region is not None]
    if seen.circle is None or not whole:
        return None
    arm = np.array([region.centre_px for region in whole]) - seen.circle.centre_px
    return outline_turn(whole, np.unwrap(np.arctan2(arm[:, 1], arm[:, 0])))


def _marker(seen: Detections) -> tuple[float, float] | None:
    if seen.head is not None or seen.shakes is not None or seen.lens.calibration is not None:
        return None
    if seen.marker is not None:
        x, y = seen.marker.centre_px
    elif seen.lens.is_identity:
        return None
    else:  # a slanted view was undone: the line is then to be seen from where the picture shows its centre
        x, y = seen.lens.distort(seen.pivot.centre_px)
    return float(x), float(y)


def _duplicates(line: Floats, sigma: Floats, repeated: NDArray[np.bool_]) -> list[int]:
    """List the frames that repeat the one before while the mechanism moves before and after them."""
    rows: list[int] = []
    starts = np.flatnonzero(repeated & ~np.insert(repeated[:-1], 0, False))
    for i in starts:
        j = int(i)
        while j + 1 < len(repeated) and repeated[j + 1]:
            j += 1
        if i < 2 or j + 1 >= len(line):
            continue
        steps = np.array([line[i - 1] - line[i - 2], line[j + 1] - line[j]])
        if (np.abs(steps) > _MOVING * sigma[i - 1]).all():
            rows.extend(range(int(i), j + 1))
    return rows
