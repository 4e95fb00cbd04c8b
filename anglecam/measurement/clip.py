"""Measure the angle in every frame of a clip: a coarse pass by the mark's position, a fine pass by the whole body.

`anglecam.measurement.mark_pass` finds mark and pivot. Where more of the body than the mark is rigid and has edges,
`anglecam.measurement.registration_pass` finds the rotation of the whole body. The result with the smaller uncertainty
is used.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from anglecam.camera.shutter import measurement_time, rig_as_shown
from anglecam.data.camera_evidence import CameraEvidence
from anglecam.data.command import Command
from anglecam.data.series import OK, AngleSeries
from anglecam.data.typing import Flags, Floats
from anglecam.io.rig import Rig
from anglecam.io.session import recording_name
from anglecam.measurement.angles import Angles, coarse_angles, turns
from anglecam.measurement.carried_marks import carried_marks, smeared_marks, with_marks
from anglecam.measurement.clock_sync import DARK, note_on, offset_of, on_clip_clock, see_lamp
from anglecam.measurement.detections import Detections
from anglecam.measurement.duplicates import duplicate_frames
from anglecam.measurement.fine_angles import fine_angles
from anglecam.measurement.mark_pass import detect_mark
from anglecam.measurement.registration_pass import Registered, Start, register_clip
from anglecam.measurement.rigid_body_pass import detect_rigid_body
from anglecam.measurement.series import series_of_angles, why_zero_is_elsewhere
from anglecam.measurement.trust import require_rotation, why_few
from anglecam.video.film import Film
from anglecam.vision.mark.outline_turn import outline_turn
from anglecam.vision.rigid_body.centre_of_rotation import RigidMotion

_AGREE = 2.0
"""Standard uncertainties by which two measurements of the rotation may differ."""
_LARGER = 2.0
"""Least size of a body, relative to the mark's radius, from which on it is not the mark."""


@dataclass(frozen=True)
class Measurement:
    """The result of measuring a clip."""

    series: AngleSeries
    detections: Detections
    """Result of the coarse pass."""
    angles: Angles
    """The measured frames, and the contributions to their uncertainty."""
    why_coarse: str | None
    """Cause why the angles are those of the mark alone; ``None`` where they are those of the whole body."""
    zero: str | None
    """Message where zero is not the rest before the first command change."""
    clock: str | None
    """Message where the lamp shows an offset between the command's clock and the clip's, or is not seen."""

    interlaced: str | None = None
    """Message where frames show two instants, of which one is measured."""
    few: str | None = None
    """Message where less than the required share of the frames is measured."""

    @property
    def pivot(self) -> str:
        """Source of the pivot's position."""
        return self.angles.pivot.source

    @property
    def by(self) -> str:
        """Object that the angles were measured on."""
        if self.why_coarse is None:
            return "whole body"
        return self.detections.by

    @property
    def truncated(self) -> str | None:
        """How much could be read of a file that ends too early; ``None`` for a complete file."""
        return self.detections.truncated

    @property
    def doubt(self) -> str | None:
        """Why the clip as a whole is no success although frames of it are measured; ``None`` where it is one."""
        return self.truncated or self.few

    @property
    def notes(self) -> tuple[str, ...]:
        """Messages to the user, a line each."""
        coarse = None if self.why_coarse is None else f"measured on the {self.by} alone: {self.why_coarse}"
        # the whole body shows the pivot itself
        doubt = None if self.why_coarse is None else self.detections.pivot.doubt
        found = (doubt, coarse, self.interlaced, self.zero, self.clock)
        return (*self.detections.notes, *(note for note in found if note is not None))

    @property
    def contours_px(self) -> tuple[NDArray[np.int32] | None, ...]:
        """Each frame's (k, 2) outline of the mark, where one was found."""
        return tuple(None if r is None else r.contour_px for r in self.detections.regions)


def measure_clip(
    film: Film, rig: Rig, command: Command | None = None, *, progress: Callable[[int, int], None] | None = None
) -> Measurement:
    """Measure the angle in every frame of a clip.

    Parameters
    ----------
    film : Film
        The clip.
    rig : Rig
        Declares mark, pivot, direction, neutral and camera.
    command : Command, optional
        Its first change ends the rest that defines neutral. Where the rig declares a lamp, the lamp dates that change.
    progress : callable, optional
        Called with (frames done, frames in all) after each frame.

    Returns
    -------
    Measurement
        Its series has a row for every frame of the film that the rig wants, measured or not.

    Raises
    ------
    InputError
        Where the file cannot be read, or no frame of it can be measured: one line with file, count and cause.
    """
    rig = rig_as_shown(rig, film)
    changes = command is not None and command.first_change() is not None
    lamp = see_lamp(film, rig) if changes else None
    offset = offset_of(command, lamp)
    command = on_clip_clock(command, offset)
    detections = detect_mark(film, rig, progress)
    ok = np.array([s == OK for s in detections.status])
    row = _mark_rows(detections)
    time = measurement_time(detections.time, row, detections.size[1], rig.camera.row_time_s)
    angles = coarse_angles(detections, ok, time, rig, command)
    why_coarse: str | None = "the body has too few features" if detections.moves else "the mark does not move"
    if detections.moves and detections.by != "outline":
        start = _start(detections, ok, time, row, angles, rig)
        registered = register_clip(film, start, detections.lens, progress)
        why_coarse = registered if isinstance(registered, str) else None
        if isinstance(registered, Registered):
            registered = replace(registered, turn=registered.turn - _rolls(detections))
            start = replace(start, turn=start.turn - _rolls(detections))
            found = np.isfinite(registered.turn)
            ok |= found & smeared_marks(detections, start, registered, float(np.median(angles.lever_px)))
            carried = carried_marks(detections, ok, registered)
            detections = with_marks(detections, carried)
            ok |= np.array([region is not None for region in carried])
            row = np.where(found, registered.row, row)
            time = measurement_time(detections.time, row, detections.size[1], rig.camera.row_time_s)
            angles = coarse_angles(detections, ok, time, rig, command)
            filmed = detections.in_picture(_in_all_frames(ok, angles.mark_px))[ok]
            angles = fine_angles(angles, registered, np.flatnonzero(ok), filmed, time[ok], rig, command)
        elif _pivot_from_path_alone(detections, rig):
            # a centre fitted to the mark's path is much less certain than the centre of rotation of the whole body
            body = detect_rigid_body(film, rig)
            if isinstance(body, Detections) and body.body is not None and _shows_rotation(body.body, detections, ok):
                rigid = np.array([s == OK for s in body.status])
                other = coarse_angles(body, rigid, body.time, rig, command)
                surer = (other.sigma**2).mean() < (angles.sigma**2).mean()
                if surer and _agree(angles, ok, other, rigid, rig):
                    detections, ok, time, angles = body, rigid, body.time, other
    require_rotation(film.path, detections, ok, angles, rig)
    series = _series(film.path, rig, time, detections, ok, angles, lamp)
    zero = why_zero_is_elsewhere(rig, command, time[ok])
    dark = changes and lamp is None and rig.sync.lamp is not None
    clock = DARK if dark else note_on(offset)
    few = why_few(series.status, rig.least_measured)
    return Measurement(series, detections, angles, why_coarse, zero, clock, _interlaced(film), few)


def _interlaced(film: Film) -> str | None:
    count = film.interlaced
    return (
        f"{count} frames are interlaced: of their two instants the first is measured, on half of the rows"
        if count
        else None
    )


def _pivot_from_path_alone(detections: Detections, rig: Rig) -> bool:
    """Return whether the pivot is only the centre of the mark's path, and a rigid body could be followed instead."""
    followable = detections.body is None and detections.camera_moves is None and detections.lens.is_identity
    return followable and detections.pivot.source == "centre of rotation" and rig.pivot.expected is None


def _shows_rotation(body: RigidMotion, detections: Detections, ok: Flags) -> bool:
    """Return whether a body is larger than the mark, which shows its own rotation no better, and as often seen."""
    areas = [
        region.area_px2 for region, seen in zip(detections.regions, ok, strict=True) if seen and region is not None
    ]
    larger = body.extent_px > _LARGER * float(np.sqrt(np.median(areas) / np.pi))
    return larger and bool(np.isfinite(body.turn[ok]).all())


def _agree(one: Angles, ok: Flags, other: Angles, other_ok: Flags, rig: Rig) -> bool:
    """Return whether two measurements of the rotation agree within their uncertainty."""
    both = ok & other_ok
    apart = turns(one, rig)[both[ok]] - turns(other, rig)[both[other_ok]]
    expected = one.sigma[both[ok]] ** 2 + other.sigma[both[other_ok]] ** 2
    return bool(both.any()) and float(apart.var()) < _AGREE**2 * float(expected.mean())


def _in_all_frames(ok: NDArray[np.bool_], places_px: Floats) -> Floats:
    """Arrange the positions of the measured frames in all frames; NaN elsewhere."""
    placed = np.full((len(ok), 2), np.nan)
    placed[ok] = places_px
    return placed


def _rolls(detections: Detections) -> Floats:
    """Return (n,) roll of the camera in each frame, rad."""
    return (
        np.zeros(len(detections.time))
        if detections.camera_moves is None
        else np.array([move.roll for move in detections.camera_moves])
    )


def _mark_rows(detections: Detections) -> Floats:
    """Return (n,) rows of the picture in which the mark was found, px."""
    places = detections.places_px
    if detections.body is not None:
        seen = np.isfinite(detections.body.turn)[:, None]
        places = np.where(seen, detections.lens.rectify(detections.body.centre_px), np.nan)
    return np.asarray(detections.in_picture(places)[:, 1])


def _start(detections: Detections, ok: NDArray[np.bool_], time: Floats, row: Floats, angles: Angles, rig: Rig) -> Start:
    """Return the coarse rotation in all frames, as the fine pass starts from it."""
    n = len(time)
    turn, sigma, speed = np.full(n, np.nan), np.full(n, np.nan), np.zeros(n)
    turn[ok], sigma[ok] = turns(angles, rig), angles.sigma
    guessed = np.flatnonzero(detections.smeared)
    if len(guessed):
        arm = np.array([r.centre_px for i in guessed if (r := detections.regions[i])]) - detections.pivot.centre_px
        line = np.arctan2(-arm[:, 1], arm[:, 0] if rig.facing == "right" else -arm[:, 0])
        near = line - np.median(angles.line)
        near -= 2.0 * np.pi * np.round(near / (2.0 * np.pi))
        turn[guessed] = near if rig.facing == "right" else -near
    known = np.isfinite(turn)
    turn = np.interp(time, time[known], turn[known])
    row = np.interp(time, time[known], row[known])
    if rig.camera.row_time_s is not None and known.sum() > 1:
        speed = np.gradient(turn, time)
    pivots, covariance = np.broadcast_to(detections.pivot.centre_px, (n, 2)), None
    if detections.camera_moves is not None:
        pivots = detections.lens.rectify(detections.in_picture(pivots))
        filmed = detections.lens.distort(detections.pivot.centre_px)
        covariance = np.array([move.place_covariance(filmed) for move in detections.camera_moves])
        turn = turn + _rolls(detections)
    return Start(
        turn=turn,
        sigma=sigma,
        pivot=detections.pivot,
        pivots_px=pivots,
        pivot_covariance_px2=covariance,
        turn_per_row=speed * (rig.camera.row_time_s or 0.0),
        row=row,
    )


def _series(
    path: Path,
    rig: Rig,
    time: Floats,
    detections: Detections,
    ok: NDArray[np.bool_],
    angles: Angles,
    lamp: tuple[float, float] | None,
) -> AngleSeries:
    """Return the series of all frames, the duplicates marked."""
    status = [OK if k else s for k, s in zip(ok, detections.status, strict=True)]
    lines, noise = np.full((2, len(time)), np.nan)
    lines[ok], noise[ok] = angles.line, angles.frame_noise(ok)
    for i in duplicate_frames(lines, noise, detections.repeated):
        status[i] = "duplicate"
    marks = detections.in_picture(_in_all_frames(ok, angles.mark_px))
    pivots = detections.in_picture(np.broadcast_to(angles.pivot.centre_px, (len(time), 2)))
    from_mark = detections.body is None and angles.registered is None
    evidence = CameraEvidence(
        picture_px=detections.size,
        marker_px=_marker(detections),
        from_mark=from_mark,
        outline_turn=_outline_turn(detections, ok) if from_mark else None,
        lamp_s=lamp,
    )
    return series_of_angles(recording_name(path), time, status, ok, angles, marks, pivots, rig, evidence)


def _outline_turn(detections: Detections, ok: NDArray[np.bool_]) -> tuple[float, float] | None:
    regions = [detections.regions[i] for i in np.flatnonzero(ok)]
    whole = [region for region in regions if region is not None]
    if detections.circle is None or not whole:
        return None
    arm = np.array([region.centre_px for region in whole]) - detections.circle.centre_px
    return outline_turn(whole, np.unwrap(np.arctan2(arm[:, 1], arm[:, 0])))


def _marker(detections: Detections) -> tuple[float, float] | None:
    if detections.body is not None or detections.camera_moves is not None or detections.lens.calibration is not None:
        return None
    if detections.marker is not None:
        x, y = detections.marker.centre_px
    elif detections.lens.is_identity:
        return None
    else:  # a slanted view was corrected: the line then starts at the position of its centre in the picture
        x, y = detections.lens.distort(detections.pivot.centre_px)
    return float(x), float(y)
