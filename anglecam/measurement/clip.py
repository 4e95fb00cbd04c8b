"""Measure the angle in every frame of a clip, and say what limits the result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from anglecam.camera.shutter import rig_as_shown
from anglecam.data.camera_evidence import CameraEvidence
from anglecam.data.command import Command
from anglecam.data.series import OK, AngleSeries, Body
from anglecam.data.typing import Flags, Floats
from anglecam.engine.every_body import MOST
from anglecam.errors import InputError
from anglecam.io.rig import Rig
from anglecam.io.session import recording_name
from anglecam.measurement.angles import Angles
from anglecam.measurement.bodies import (
    body_name,
    first_body,
    found_body,
    note_on_others,
    other_finalists,
    renumbered,
)
from anglecam.measurement.camera_pass import FilmAtRest, as_seen_at_rest, hold_camera
from anglecam.measurement.clock_sync import DARK, note_on, offset_of, on_clip_clock, see_lamp
from anglecam.measurement.detections import Detections, in_all_frames
from anglecam.measurement.duplicates import duplicate_frames
from anglecam.measurement.followed import Followed, follow_mark_or_body
from anglecam.measurement.other_bodies import OtherBody, of_any_body, other_bodies
from anglecam.measurement.series import series_of_angles, why_zero_is_elsewhere
from anglecam.measurement.trust import why_few
from anglecam.progress import Progress, Stage, unseen
from anglecam.video.film import Film
from anglecam.vision.mark.found_mark import FoundMark
from anglecam.vision.mark.outline_turn import outline_turn

_HAND_HELD = "the camera moves and comes nearer; the clip is measured as seen from its place in the first frame"


@dataclass(frozen=True)
class Measurement:
    """The result of measuring a clip."""

    series: AngleSeries
    detections: Detections
    """Result of the coarse pass."""
    angles: Angles
    """The measured frames, and the contributions to their uncertainty."""
    ok: Flags
    """(frames,) the measured frames; repeated ones count."""
    why_coarse: str | None
    """Cause why the angles are those of the mark alone; ``None`` where they are those of the whole body."""
    zero: str | None
    """Message where zero is not the rest before the first command change."""
    clock: str | None
    """Message where the lamp shows an offset between the command's clock and the clip's, or is not seen."""

    interlaced: str | None = None
    """Message where frames show two instants, of which one is measured."""
    unsure: str | None = None
    """Message where less than the required share of the frames is measured, or what is measured may be another
    thing."""

    bodies: tuple[Body, ...] = ()
    """What is seen to move, the measured body first."""
    several: str | None = None
    """Message where another thing turns as well, and the rig does not say which one is meant."""

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
        return self.truncated or self.unsure

    @property
    def notes(self) -> tuple[str, ...]:
        """Messages to the user, a line each."""
        coarse = None if self.why_coarse is None else f"measured on the {self.by} alone: {self.why_coarse}"
        # the whole body shows the pivot itself
        doubt = None if self.why_coarse is None else self.detections.pivot.doubt
        found = (doubt, coarse, self.several, self.interlaced, self.zero, self.clock)
        return (*self.detections.notes, *(note for note in found if note is not None))

    @property
    def contours_px(self) -> tuple[NDArray[np.int32] | None, ...]:
        """Each frame's (k, 2) outline of the mark, where one was found."""
        return tuple(None if r is None else r.contour_px for r in self.detections.regions)


def measure_clip(
    film: Film,
    rig: Rig,
    command: Command | None = None,
    *,
    progress: Progress = unseen,
    mark: FoundMark | None = None,
    every_body: bool = False,
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
    progress : Progress
        Called with each stage, and after each frame of those that go through the frames.
    mark : FoundMark, optional
        The mark, where it was found before (`anglecam.measurement.mark_pass.seek_mark`); then nothing else is followed.
    every_body : bool
        Whether to look for all bodies that move, and to measure those that turn. Otherwise those are stated that are
        known without a further look.

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
    lamp = see_lamp(film, rig, progress) if changes else None
    offset = offset_of(command, lamp)
    command = on_clip_clock(command, offset)
    film.learn(progress)
    camera = hold_camera(film, progress)
    held = camera.film
    rig = as_seen_at_rest(rig, held)
    followed = follow_mark_or_body(camera, rig, command, progress, mark)
    others: list[OtherBody] = []
    if every_body or (rig.body or 1) > 1:
        others = other_bodies(camera, rig, command, followed, progress, MOST if every_body else rig.body or 1)
    progress(Stage("working out angles and uncertainties"))
    bodies = _bodies(held, rig, followed, others, lamp)
    seen = [one.moving for one in others] or other_finalists(followed.detections)
    note = note_on_others(bodies[0], seen, followed.detections, rig)
    if not others:
        bodies += tuple(found_body(number, one, None, None) for number, one in enumerate(seen, start=2))
    wanted = rig.body or 1
    if wanted > 1:
        followed = _wanted(film, others, wanted)
        name = recording_name(film.path)
        bodies = renumbered([bodies[wanted - 1], *bodies[: wanted - 1], *bodies[wanted:]], name)
        rig = of_any_body(rig)
    if not every_body:
        bodies = (bodies[0], *(replace(body, series=None, relative=None) for body in bodies[1:]))
    detections, series = _as_filmed(followed.detections, held), bodies[0].series
    assert series is not None
    zero = why_zero_is_elsewhere(rig, command, followed.time[followed.ok])
    dark = changes and lamp is None and rig.sync.lamp is not None
    clock = DARK if dark else note_on(offset)
    followed_too = [one.followed for one in others if every_body and one.followed is not None]
    doubts = (why_few(series.status, rig.least_measured), *(one.doubt for one in (followed, *followed_too)))
    unsure = next(filter(None, doubts), None)
    interlaced = _interlaced(film)
    return Measurement(
        series,
        detections,
        followed.angles,
        followed.ok,
        followed.why_coarse,
        zero,
        clock,
        interlaced,
        unsure,
        bodies,
        note,
    )


def _interlaced(film: Film) -> str | None:
    count = film.interlaced
    return (
        f"{count} frames are interlaced: of their two instants the first is measured, on half of the rows"
        if count
        else None
    )


def _as_filmed(detections: Detections, film: Film) -> Detections:
    """Return the detections with the outlines where the camera saw them, and a note, if it was held in the hand."""
    if not isinstance(film, FilmAtRest):
        return detections
    regions = [
        None if region is None or move is None else replace(region, contour_px=_moved(region.contour_px, move))
        for region, move in zip(detections.regions, film.moves, strict=True)
    ]
    unknown = [move is None for move in film.moves]
    status = ["occluded" if lost and s != OK else s for lost, s in zip(unknown, detections.status, strict=True)]
    notes = (*detections.notes, _HAND_HELD)
    return replace(detections, regions=tuple(regions), status=tuple(status), notes=notes)


def _moved(contour_px: NDArray[np.int32], move: Floats) -> NDArray[np.int32]:
    moved = cv2.perspectiveTransform(contour_px.reshape(-1, 1, 2).astype(np.float64), move)
    return np.asarray(moved.round().astype(np.int32).reshape(contour_px.shape))


def _bodies(
    film: Film, rig: Rig, first: Followed, others: Sequence[OtherBody], lamp: tuple[float, float] | None
) -> tuple[Body, ...]:
    """Return the bodies that were measured, with their series."""
    name = recording_name(film.path)
    bodies = [first_body(first, _series(film, rig, first, name, np.zeros((len(first.ok), 2)), lamp))]
    for number, one in enumerate(others, start=2):
        series = None
        if one.followed is not None:
            series = _series(film, of_any_body(rig), one.followed, body_name(name, number), one.shifts_px, lamp)
        carrier = None if one.moving.joint_to is None else bodies[one.moving.joint_to].series
        bodies.append(found_body(number, one.moving, series, carrier))
    return tuple(bodies)


def _wanted(film: Film, others: Sequence[OtherBody], wanted: int) -> Followed:
    """Return the angles of the body that is declared to be the first.

    Raises
    ------
    InputError
        Where there is no such body, or its angles could not be measured.
    """
    declared = f"{film.path}: body: {wanted} is declared in rig.yaml, but"
    if wanted > 1 + len(others):
        raise InputError(f"{declared} only {1 + len(others)} are seen to move")
    found = others[wanted - 2]
    if found.followed is None:
        raise InputError(f"{declared} {found.cause}")
    return found.followed


def _series(
    film: Film,
    rig: Rig,
    followed: Followed,
    name: str,
    shifts_px: Floats,
    lamp: tuple[float, float] | None,
) -> AngleSeries:
    """Return the series of all frames, the duplicates marked; the pivot is shifted by (n, 2)."""
    detections, ok, angles = followed.detections, followed.ok, followed.angles
    filmed = _as_filmed(detections, film).status
    status = [OK if k else s for k, s in zip(ok, filmed, strict=True)]
    lines, noise = np.full((2, len(status)), np.nan)
    lines[ok], noise[ok] = angles.line, angles.frame_noise(ok)
    for i in duplicate_frames(lines, noise, detections.repeated):
        status[i] = "duplicate"
    marks = detections.in_picture(in_all_frames(ok, angles.mark_px) + shifts_px)
    pivots = detections.in_picture(angles.pivot.centre_px + shifts_px)
    hand_held = isinstance(film, FilmAtRest)
    if isinstance(film, FilmAtRest):
        marks, pivots = film.in_picture(marks), film.in_picture(pivots)
    from_mark = detections.body is None and angles.registered is None
    evidence = CameraEvidence(
        picture_px=detections.size,
        marker_px=None if hand_held else _marker(detections),
        from_mark=from_mark,
        outline_turn=_outline_turn(detections, ok) if from_mark else None,
        lamp_s=lamp,
    )
    time = followed.time
    return series_of_angles(name, time, status, ok, angles, marks, pivots, rig, evidence)


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
