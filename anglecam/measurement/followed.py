"""What is followed in a clip, and its angle: the mark, or else a rigid body, or else the outline of what moves.

`anglecam.measurement.mark_pass` finds mark and pivot. Where more of the body than the mark is rigid and has edges,
`anglecam.measurement.registration_pass` finds the rotation of the whole body. The result with the smaller uncertainty
is used. Where no mark is declared and none is found, a body is followed without one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from anglecam.camera.shutter import measurement_time
from anglecam.data.command import Command
from anglecam.data.series import OK
from anglecam.data.typing import Flags, Floats
from anglecam.errors import InputError
from anglecam.io.rig import Rig
from anglecam.measurement.angles import Angles, coarse_angles, turns
from anglecam.measurement.camera_pass import HeldCamera
from anglecam.measurement.carried_marks import carried_marks, smeared_marks, with_marks
from anglecam.measurement.detections import Detections, in_all_frames
from anglecam.measurement.fine_angles import fine_angles
from anglecam.measurement.mark_pass import MarkNotFoundError, detect_mark
from anglecam.measurement.one_rigid_mark import reaches_over_pivot
from anglecam.measurement.registration_pass import Registered, Start, register_clip
from anglecam.measurement.rigid_body_pass import detect_layer, detect_outline, detect_rigid_body
from anglecam.measurement.trust import require_rotation, why_off_circle
from anglecam.progress import Progress, unseen
from anglecam.video.film import Film
from anglecam.vision.mark.found_mark import FoundMark
from anglecam.vision.rigid_body.centre_of_rotation import RigidMotion

Follow = Callable[[Film, Rig, Progress], Detections | str]
"""Follows a body without a mark, as `detect_rigid_body` does."""
_AGREE = 2.0
"""Standard uncertainties by which two measurements of the rotation may differ."""
_AS_OFTEN = 0.9
"""Least share of the frames in which another thing is measured, for a mark to count as seen as often."""
_LARGER = 2.0
"""Least size of a body, relative to the mark's radius or to a registered part, from which on it is another one."""


@dataclass(frozen=True)
class Followed:
    """The angle of one of the things that can be followed in a clip."""

    detections: Detections
    ok: Flags
    """(n,) the measured frames."""
    time: Floats
    """(n,) of all frames, s."""
    angles: Angles
    """Of the measured frames."""
    why_coarse: str | None
    """Cause why the angle is not that of the whole body; ``None`` where it is."""


def follow_mark_or_body(
    camera: HeldCamera,
    rig: Rig,
    command: Command | None,
    progress: Progress = unseen,
    known: FoundMark | None = None,
) -> Followed:
    """Measure the angle of the mark or, where none is declared and none is found, of a rigid body or its outline.

    Parameters
    ----------
    camera : HeldCamera
        The clip, and how its camera moves.
    rig : Rig
        Declares mark, pivot, direction, neutral and camera.
    command : Command, optional
        Its first change ends the rest that defines neutral.
    progress : Progress
        Called with each stage, and after each frame.
    known : FoundMark, optional
        The mark, where it was found before; then nothing else is followed.

    Returns
    -------
    Followed
        The mark, or the first body that turns about a fixed pivot.

    Raises
    ------
    InputError
        Where nothing turns about a fixed pivot: one line with the causes.
    """
    film = camera.film
    try:
        mark = detect_mark(film, rig, camera, progress, known)
        followed = _measured(film, rig, command, mark, progress)
        return _hinted(followed, film, rig, command, progress) if _is_hinted(camera, rig) else followed
    except MarkNotFoundError as problem:
        causes, ways = [str(problem)], _without_mark(camera, rig)
    except InputError as problem:  # the mark moves otherwise; what turns may be another thing, or more than the mark
        causes, ways = [str(problem)], _besides_mark(camera, rig)
    for follow in ways if known is None else ():
        try:
            body = follow(film, rig, progress)
            if isinstance(body, Detections):
                return _measured(film, rig, command, body, progress)
            causes.append(body)
        except InputError as problem:
            causes.append(str(problem).removeprefix(f"{film.path}: "))
    found, *others = dict.fromkeys(causes)  # body and outline may fail for the same cause
    besides = f"; nor can a body be followed without a mark: {', and '.join(others)}" if others else ""
    raise InputError(found + besides)


def _without_mark(camera: HeldCamera, rig: Rig) -> list[Follow]:
    """Return the ways in which a body may be followed where no mark is declared by its colour."""
    if rig.mark_rgb is not None or camera.film.undecodable == len(camera.film.times):
        return []
    by_outline = [detect_outline] if camera.steady is None and rig.pointed_mark is None else []
    return [detect_rigid_body, *by_outline, *([detect_layer] if _is_hinted(camera, rig) else [])]


def _besides_mark(camera: HeldCamera, rig: Rig) -> list[Follow]:
    """Return the ways in which a body may be followed where what was taken for the mark does not turn.

    Where somebody declared the mark or the pivot, no other thing may take its place but one that turns about the hint.
    """
    if _is_hinted(camera, rig):
        return [detect_layer]
    declared = rig.pointed_mark is not None or rig.pivot.expected is not None
    return [] if declared or camera.unknown is not None else _without_mark(camera, rig)


def _hinted(mark: Followed, film: Film, rig: Rig, command: Command | None, progress: Progress) -> Followed:
    """Return the rotation about the hinted pivot, where it is not clear what the mark is, or the mark reaches over it.

    Raises
    ------
    InputError
        Where the mark and what turns about the hint move otherwise, and the mark is seen as often.
    """
    replaceable = mark.detections.by == "mark" and mark.detections.lens.is_identity
    reaches_over = replaceable and reaches_over_pivot(mark.detections, mark.ok, mark.angles)
    registered = mark.angles.registered
    if not replaceable or not (reaches_over or (registered is None and not mark.detections.clear)):
        return mark
    try:
        layer = detect_layer(film, rig, progress)
        other = None if isinstance(layer, str) else _measured(film, rig, command, layer, progress)
    except InputError:
        other = None
    if other is None or other.detections.body is None:
        return mark
    part = None if registered is None else registered.appearance.extent_px
    if part is not None and other.detections.body.extent_px < _LARGER * part:
        return mark
    if mark.ok.sum() < _AS_OFTEN * other.ok.sum():
        return other
    if _agree(mark.angles, mark.ok, other.angles, other.ok, rig):
        # a registered part that is small beside the whole is of few tiles, whose errors its uncertainty leaves out
        surer = part is not None or _shows_it_better(mark.angles, mark.ok, other.angles, other.ok, rig)
        return other if surer else mark
    raise InputError(
        f"{film.path}: two things turn differently about the hinted pivot; declare one: mark: {{at: [x, y], frame: k}}"
        " in rig.yaml"
    )


def _is_hinted(camera: HeldCamera, rig: Rig) -> bool:
    """Return whether a thing is to be found by its pivot alone, in the picture of a camera at rest."""
    at_rest = camera.steady is None and camera.unknown is None
    undeclared = rig.mark_rgb is None and rig.pointed_mark is None
    return at_rest and undeclared and rig.pivot.expected is not None


def _measured(
    film: Film,
    rig: Rig,
    command: Command | None,
    detections: Detections,
    progress: Progress,
) -> Followed:
    """Return the angles of what was detected, finer where more of the body than the mark can be registered."""
    ok = np.array([s == OK for s in detections.status])
    row = _mark_rows(detections)
    time = measurement_time(detections.time, row, detections.size[1], rig.camera.row_time_s)
    angles = coarse_angles(detections, ok, time, rig, command)
    why_coarse: str | None = "the body has too few features" if detections.moves else "the mark does not move"
    if detections.moves and detections.by not in ("outline", "layer"):
        start = _start(detections, ok, time, row, angles, rig)
        registered = register_clip(film, start, detections.lens, progress, detections.turns)
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
            filmed = detections.in_picture(in_all_frames(ok, angles.mark_px))[ok]
            angles = fine_angles(angles, registered, np.flatnonzero(ok), filmed, time[ok], rig, command)
        elif _may_follow_body(detections, rig) and why_off_circle(detections, angles) is None:
            # a centre fitted to the mark's path is often much less certain than that of the whole body's rotation
            body = detect_rigid_body(film, rig, progress)
            if isinstance(body, Detections) and body.body is not None and _shows_rotation(body.body, detections, ok):
                rigid = np.array([s == OK for s in body.status])
                other = coarse_angles(body, rigid, body.time, rig, command)
                if _shows_it_better(angles, ok, other, rigid, rig):
                    detections, ok, time, angles = body, rigid, body.time, other
    require_rotation(film.path, detections, ok, angles, rig)
    return Followed(detections, ok, time, angles, why_coarse)


def _may_follow_body(detections: Detections, rig: Rig) -> bool:
    """Return whether nobody declared the pivot, and a rigid body could be followed instead of the mark."""
    followable = detections.body is None and detections.camera_moves is None and detections.lens.is_identity
    return followable and detections.moves and rig.pivot.expected is None


def _shows_rotation(body: RigidMotion, detections: Detections, ok: Flags) -> bool:
    """Return whether a body is larger than the mark, which shows its own rotation no better, and as often seen."""
    areas = [
        region.area_px2 for region, seen in zip(detections.regions, ok, strict=True) if seen and region is not None
    ]
    larger = body.extent_px > _LARGER * float(np.sqrt(np.median(areas) / np.pi))
    return larger and bool(np.isfinite(body.turn[ok]).all())


def _shows_it_better(mark: Angles, ok: Flags, body: Angles, body_ok: Flags, rig: Rig) -> bool:
    """Return whether a body's rotation agrees with the mark's and is surer.

    What their uncertainties do not explain of their difference counts against the mark: light that displaces its
    centre, or an error of the pivot, hardly changes the rotation of a body that is seen on itself.
    """
    if not _agree(mark, ok, body, body_ok, rig):
        return False
    apart, of_mark, of_body = _variances(mark, ok, body, body_ok, rig)
    return of_body < of_mark + max(apart - of_mark - of_body, 0.0)


def _agree(mark: Angles, ok: Flags, body: Angles, body_ok: Flags, rig: Rig) -> bool:
    """Return whether two rotations are seen together, and differ by no more than their uncertainties explain."""
    if not (ok & body_ok).any():
        return False
    apart, of_mark, of_body = _variances(mark, ok, body, body_ok, rig)
    return apart < _AGREE**2 * (of_mark + of_body)


def _variances(mark: Angles, ok: Flags, body: Angles, body_ok: Flags, rig: Rig) -> tuple[float, float, float]:
    """Return the variance of the difference of two rotations, and the mean of each one's own, rad²."""
    both = ok & body_ok
    one, other = both[ok], both[body_ok]
    apart = float((turns(mark, rig)[one] - turns(body, rig)[other]).var())
    return apart, float((mark.sigma[one] ** 2).mean()), float((body.sigma[other] ** 2).mean())


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
