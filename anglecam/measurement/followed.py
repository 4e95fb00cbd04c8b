"""What is followed in a clip, and its angle: the mark, or else the body that turns.

`anglecam.measurement.mark_pass` finds a red or a declared mark, and its pivot. Without one,
`anglecam.measurement.body_pass` finds what turns. Where more of the body is rigid and has edges,
`anglecam.measurement.registration_pass` finds the rotation of all of it. The result with the smaller uncertainty is
used.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from anglecam.camera.shutter import measurement_time
from anglecam.data.command import Command
from anglecam.data.series import OK
from anglecam.data.typing import Flags, Floats
from anglecam.engine.hints import Hints
from anglecam.errors import InputError
from anglecam.io.rig import Rig
from anglecam.measurement.angles import Angles, coarse_angles, turns
from anglecam.measurement.body_pass import detect_body, hints_of
from anglecam.measurement.camera_pass import FilmAtRest, HeldCamera
from anglecam.measurement.carried_marks import carried_marks, smeared_marks, with_marks
from anglecam.measurement.detections import Detections, in_all_frames
from anglecam.measurement.fine_angles import fine_angles
from anglecam.measurement.mark_pass import detect_mark
from anglecam.measurement.registration_pass import Registered, Start, register_clip
from anglecam.measurement.trust import why_doubtful, why_few, why_no_rotation, why_still
from anglecam.measurement.white_noise import beyond_stated
from anglecam.measurement.without_hint import UNUSED, is_meant, without_hints
from anglecam.progress import Progress, unseen
from anglecam.video.film import Film
from anglecam.vision.mark.found_mark import FoundMark
from anglecam.vision.status import UNDECODABLE

_MANY = 0.05
"""Share of the frames without an angle from which on the body is looked for beside the mark, and what is found without
a hint beside what is found with it. It saves that time where these could add few frames; it does not choose."""
_ANOTHER = 3.0
"""Usual difference of two angles, in standard uncertainties, beyond which they are those of two bodies: of one it is
0.67."""


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
    doubt: str | None
    """Why the clip is no success although frames of it are measured; ``None`` where it is one."""

    @property
    def elsewhere(self) -> bool:
        """Whether it turns about another point than the hint says."""
        return self.detections.pivot.elsewhere

    @property
    def lost(self) -> float:
        """Share of the decoded frames that are not measured."""
        decoded = np.array([s != UNDECODABLE for s in self.detections.status])
        return float((~self.ok[decoded]).mean()) if decoded.any() else 0.0


def follow_mark_or_body(
    camera: HeldCamera,
    rig: Rig,
    command: Command | None,
    progress: Progress = unseen,
    known: FoundMark | None = None,
) -> Followed:
    """Measure the angle of the mark or, where no colour is declared and no mark surely turns, of the body that turns.

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
        The mark or the body.

    Raises
    ------
    InputError
        Where nothing turns about a fixed pivot: one line with the causes.
    """
    bare = None if known is not None or camera.unknown else without_hints(rig)
    if bare is None:
        return _follow(camera, rig, command, progress, known)
    hinted = _tried(camera, rig, command, progress)
    sure = hinted if isinstance(hinted, Followed) and hinted.doubt is None else None
    if sure is not None and sure.lost < _MANY:
        return sure
    found = _tried(camera, bare, command, progress)
    # what was followed with the hint is a better witness of what it means than a click
    meant = hints_of(camera.film, rig) if sure is None else Hints(pivot_px=sure.detections.pivot.centre_px)
    if isinstance(found, Followed) and found.doubt is None and is_meant(found.detections, meant):
        notes = (*found.detections.notes, UNUSED)
        found = replace(found, detections=replace(found.detections, notes=notes))
        return found if sure is None else _more_certain(sure, found)
    if isinstance(hinted, InputError):
        raise hinted  # what the hint names is the cause to state
    return hinted


def _tried(camera: HeldCamera, rig: Rig, command: Command | None, progress: Progress) -> Followed | InputError:
    try:
        return _follow(camera, rig, command, progress)
    except InputError as cause:
        return cause


def _follow(
    camera: HeldCamera, rig: Rig, command: Command | None, progress: Progress, known: FoundMark | None = None
) -> Followed:
    """Measure the mark or the body with a rig as it is; raise `InputError` where nothing turns."""
    film = camera.film
    mark = detect_mark(film, rig, camera, progress, known)
    by_mark = mark if isinstance(mark, str) else _measured(film, rig, command, mark, progress)
    # nothing else is meant by a colour, nor in the other parts of a film
    final = known is not None or film.undecodable == len(film.times) or rig.mark_rgb is not None
    if isinstance(by_mark, Followed):
        still = why_still(by_mark.detections, by_mark.ok, rig) is not None
        # a declared neutral is a direction of the line to the mark
        sure = by_mark.doubt is None and not by_mark.elsewhere
        seen = sure and (by_mark.lost < _MANY or rig.neutral != "auto")
        if seen or still or final or camera.unknown:
            return by_mark
    cause = camera.unknown or (by_mark if final else None) or detect_body(camera, rig, progress)
    by_body = _measured(film, rig, command, cause, progress) if isinstance(cause, Detections) else cause
    if isinstance(by_mark, Followed) and (isinstance(by_body, str) or by_body.doubt is not None):
        return by_mark
    if isinstance(by_body, str):
        raise InputError(f"{film.path}: {by_body}")
    if isinstance(by_mark, str) or by_mark.doubt is not None or (by_mark.elsewhere and not by_body.elsewhere):
        return by_body
    return _more_certain(by_mark, by_body)


def _more_certain(first: Followed, second: Followed) -> Followed:
    """Return the angles that leave less unknown of the film.

    The expected logarithmic score of a forecast decides (Good, Journal of the Royal Statistical Society B 14, 1952):
    where a frame is not measured, the angle is known as well as the spread of the motion. If the second does not turn
    as the first does, it is another body than the one that is meant.
    """
    both = first.ok & second.ok
    ones, others = (
        (in_all_frames(one.ok, one.angles.line), in_all_frames(one.ok, one.angles.sigma)) for one in (first, second)
    )
    off = np.exp(1j * (ones[0] - others[0])[both])
    off = np.angle(off / off.mean()) / np.hypot(ones[1], others[1])[both] if both.any() else np.array([np.inf])
    if np.median(np.abs(off)) > _ANOTHER:
        return first
    spread = max(float(np.std(np.unwrap(one.angles.line))) for one in (first, second))
    unknown = [
        float(np.log(np.minimum(np.where(np.isfinite(sigma), sigma, spread), spread)).mean())
        for _, sigma in (ones, others)
    ]
    return first if unknown[0] <= unknown[1] else second


def _measured(
    film: Film,
    rig: Rig,
    command: Command | None,
    detections: Detections,
    progress: Progress,
) -> Followed | str:
    """Return the angles of what was detected, finer where more of it can be registered, or why they are none."""
    ok = np.array([s == OK for s in detections.status])
    row = _mark_rows(detections)
    time = measurement_time(detections.time, row, detections.size[1], rig.camera.row_time_s)
    angles = coarse_angles(detections, ok, time, rig, command)
    registered: Registered | str | None = None
    why_coarse: str | None = "the body has too few features" if detections.moves else "the mark does not move"
    if detections.moves:
        start = _start(detections, ok, time, row, angles, rig)
        registered = register_clip(film, start, detections.lens, progress, detections.turns)
        why_coarse = registered if isinstance(registered, str) else None
        if isinstance(registered, Registered):
            registered = replace(registered, turn=registered.turn - detections.rolls)
            start = replace(start, turn=start.turn - detections.rolls)
            found = np.isfinite(registered.turn)
            ok |= found & smeared_marks(detections, start, registered, float(np.median(angles.lever_px)))
            carried = carried_marks(detections, ok, registered)
            detections = with_marks(detections, carried)
            ok |= np.array([region is not None for region in carried])
            row = np.where(found, registered.row, row)
            time = measurement_time(detections.time, row, detections.size[1], rig.camera.row_time_s)
    body = registered if isinstance(registered, Registered) else None
    angles = _angles(detections, body, ok, time, rig, command)
    scatter = beyond_stated(angles.uncertainty, time[ok], angles.line)
    if scatter > 0.0:
        detections = replace(detections, scatter=scatter)
        angles = _angles(detections, body, ok, time, rig, command)
    cause = why_no_rotation(detections, ok, angles, rig)
    if cause is not None:
        return cause
    hand_held, status = (
        isinstance(film, FilmAtRest),
        [OK if k else s for k, s in zip(ok, detections.status, strict=True)],
    )
    doubt = why_few(status, rig.least_measured) or why_doubtful(detections, ok, angles, rig, hand_held=hand_held)
    return Followed(detections, ok, time, angles, why_coarse, doubt)


def _angles(
    detections: Detections, body: Registered | None, ok: Flags, time: Floats, rig: Rig, command: Command | None
) -> Angles:
    """Return the angles of the measured frames, those of the whole body where it is registered."""
    angles = coarse_angles(detections, ok, time, rig, command)
    if body is None:
        return angles
    filmed = detections.in_picture(in_all_frames(ok, angles.mark_px))[ok]
    body = replace(body, noise=np.hypot(body.noise, detections.turn_sigma))
    return fine_angles(angles, body, np.flatnonzero(ok), filmed, time[ok], rig, command)


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
        turn = turn + detections.rolls
    return Start(
        turn=turn,
        sigma=sigma,
        pivot=detections.pivot,
        pivots_px=pivots,
        pivot_covariance_px2=covariance,
        turn_per_row=speed * (rig.camera.row_time_s or 0.0),
        row=row,
    )
