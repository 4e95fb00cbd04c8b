"""The bodies of a clip besides the one that is measured first, and the angles of those that turn.

The measured body's motion is known in every frame. With its pixels taken out, the engine looks for the next body
(`anglecam.engine.every_body`), and each one that turns is followed through all frames.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from anglecam.camera.shutter import measurement_time
from anglecam.data.command import Command
from anglecam.data.series import OK
from anglecam.data.typing import Floats
from anglecam.engine.body import Turn
from anglecam.engine.every_body import MOST, Moving, further_bodies, without
from anglecam.engine.reasons import why_ambiguous, why_jump
from anglecam.engine.refine import sensitivities
from anglecam.engine.score import Proposal, carried_by
from anglecam.engine.target import Picture
from anglecam.engine.tracking import Search, candidates, chosen, search_for
from anglecam.io.rig import Rig, RigPivot
from anglecam.measurement.angles import Angles, coarse_angles
from anglecam.measurement.body_pass import rigid_motion
from anglecam.measurement.camera_pass import HeldCamera
from anglecam.measurement.detections import Detections
from anglecam.measurement.followed import Followed
from anglecam.measurement.rigid_motion import RigidMotion
from anglecam.measurement.seen_frames import follow, moving_stills, stills_of
from anglecam.measurement.white_noise import beyond_stated
from anglecam.progress import Progress, Stage, unseen
from anglecam.vision.pivot.estimate import PivotEstimate

_UNSEEN = "it is not seen in the frames between the sampled ones"


@dataclass(frozen=True)
class OtherBody:
    """A body that was found besides the first."""

    moving: Moving
    """By the sampled frames."""
    followed: Followed | None
    """Its angles; ``None`` where they are not measured."""
    cause: str | None
    """Why they are not; ``None`` where they are."""
    shifts_px: Floats
    """(n, 2) by which its pivot is carried in each frame."""


@dataclass(frozen=True)
class _Known:
    """The motion of a body in all n frames of the clip, as a camera at rest shows it."""

    motion: Proposal
    sigma: Floats
    """(n,) standard uncertainty of its turn about its centre, rad: what the centre is off, the turns are off with it,
    and a place of the body is where its pixels are seen."""


def other_bodies(
    camera: HeldCamera,
    rig: Rig,
    command: Command | None,
    first: Followed,
    progress: Progress = unseen,
    most: int = MOST,
) -> list[OtherBody]:
    """Find the other bodies of a clip, and measure those that turn.

    Parameters
    ----------
    camera : HeldCamera
        The clip, and how its camera moves.
    rig : Rig
        Facing and camera. Mark, pivot and neutral are those of the first body.
    command : Command, optional
        Its first change ends the rest that defines neutral.
    first : Followed
        The angle of the first body.
    progress : Progress
        Called with each stage, and after each frame.
    most : int
        Bodies, the first included.

    Returns
    -------
    list of OtherBody
        In the order in which they were found, which is that of how surely.
    """
    rig = of_any_body(rig)
    learnt = first.detections.learnt
    stills = stills_of(moving_stills(camera.film), camera, None if learnt is None else learnt.sample.tint)
    measured = _of_first(first, rig)
    known: list[_Known | None] = [measured]
    progress(Stage("looking for what else moves"))
    motion = measured.motion.in_frames(np.arange(len(first.ok)), stills.frames)
    found: list[OtherBody] = []
    for moving in further_bodies(stills, motion, most):
        measured_or_cause: tuple[Followed, _Known] | str = "it is not seen to turn"
        if moving.moves == "turns":
            measured_or_cause = _measured(camera, rig, command, first.detections, moving, known, progress)
        if isinstance(measured_or_cause, str):
            known.append(None)
            found.append(OtherBody(moving, None, measured_or_cause, np.zeros((len(first.ok), 2))))
        else:
            followed, its_motion = measured_or_cause
            known.append(its_motion)
            found.append(OtherBody(moving, followed, None, _shifts(its_motion.motion)))
    return found


def of_any_body(rig: Rig) -> Rig:
    """Return a rig without mark, pivot and zero, which are those of the first body."""
    return rig.model_copy(update={"pivot": RigPivot(), "mouth": "auto", "neutral": "auto"})


def _of_first(followed: Followed, rig: Rig) -> _Known:
    """Return the motion of the body whose angle was measured, about a pivot at rest."""
    angles, ok = followed.angles, followed.ok
    turn, sigma = np.full((2, len(ok)), np.nan)
    signed = angles.line if rig.facing == "right" else -angles.line
    turn[ok], sigma[ok] = signed - np.median(signed), _about_centre(angles)
    centre = followed.detections.lens.distort(angles.pivot.centre_px)
    return _Known(Proposal("measured", centre, turn), sigma)


def _about_centre(angles: Angles) -> Floats:
    return np.hypot(angles.uncertainty.noise, angles.uncertainty.pose)


def _shifts(motion: Proposal) -> Floats:
    """Return (n, 2) by which a body's centre is carried, px."""
    if motion.carrier is None:
        return np.zeros((len(motion.turn), 2))
    return carried_by(motion.carrier, motion.centre_px)


def _measured(
    camera: HeldCamera,
    rig: Rig,
    command: Command | None,
    first: Detections,
    moving: Moving,
    known: Sequence[_Known | None],
    progress: Progress,
) -> tuple[Followed, _Known] | str:
    """Follow a body through all frames, or return why that fails."""
    carrier = None if moving.joint_to is None else known[moving.joint_to]
    if moving.joint_to is not None and carrier is None:
        return "what carries its pivot is not measured"
    sample, n = moving.sample, len(first.time)
    search = search_for(sample, moving.fit)
    motion = replace(moving.motion, turn=np.zeros(n), carrier=None if carrier is None else carrier.motion.in_film())
    shifts = _shifts(motion)
    pairs = [pair for pair in zip(moving.before, known, strict=True) if pair[1] is not None]
    targets = [target for target, _ in pairs]
    poses = [one.motion.poses(sample) for _, one in pairs if one is not None]

    def find(k: int, picture: Picture) -> list[Turn]:
        if not np.isfinite(shifts[k]).all():
            return []
        return candidates(search, without(picture, targets, [of[k] for of in poses]), shifts[k] * sample.scale)

    seen = follow(camera, sample, find, progress)
    track = chosen(seen.found, seen.time, search)
    off = (track.turn[sample.frames] - moving.motion.turn)[np.isfinite(moving.motion.turn)]
    if not np.isfinite(off).any():
        return _UNSEEN
    jump = why_jump(track.turn, camera.film.first_frame)
    if jump is not None:
        return jump
    # what it carries was found with the zero of its turns in the sample
    track = replace(track, turn=track.turn - np.nanmedian(off))
    body = rigid_motion(search, track, seen.decoded, 0.0 if carrier is None else carrier.motion.turn)
    if carrier is not None:
        body = replace(body, sigma=np.hypot(body.sigma, _by_carrier(search, track.turn, carrier)))
    doubt = why_ambiguous(track.ambiguous, camera.film.first_frame)
    detections = _detections(first, body)
    ok = np.array([s == OK for s in body.status])
    if not ok.any():
        return _UNSEEN
    rows = detections.in_picture(np.where(ok[:, None], body.centre_px + shifts, np.nan))[:, 1]
    time = measurement_time(seen.time, rows, detections.size[1], rig.camera.row_time_s)
    angles = coarse_angles(detections, ok, time, rig, command)
    scatter = beyond_stated(angles.uncertainty, time[ok], angles.line)
    if scatter > 0.0:
        detections = replace(detections, scatter=scatter)
        angles = coarse_angles(detections, ok, time, rig, command)
    sigma = np.full(n, np.nan)
    sigma[ok] = _about_centre(angles)
    followed = Followed(detections, ok, time, angles, "it was found after another body was taken out", doubt)
    return followed, _Known(replace(motion, turn=track.turn), sigma)


def _by_carrier(search: Search, turn: Floats, carrier: _Known) -> Floats:
    """Return (n,) standard uncertainty of a body's turns by that of the turns of what carries its pivot, rad."""
    by_shift = np.full((len(turn), 2), np.nan)
    known = np.isfinite(turn)
    by_shift[known] = sensitivities(search.sample, search.fit, search.body, turn[known], carrier.motion.turn[known])[1]
    arm = search.fit.proposal.centre_px - carrier.motion.centre_px
    cos, sin = np.cos(carrier.motion.turn), np.sin(carrier.motion.turn)
    moved = np.column_stack([cos * arm[1] - sin * arm[0], -cos * arm[0] - sin * arm[1]])
    return np.abs((by_shift * moved).sum(axis=1)) * carrier.sigma


def _detections(first: Detections, body: RigidMotion) -> Detections:
    """Return what was detected of a body, in the frames and with the camera of the first one."""
    J = first.lens.jacobian(body.pivot_px)
    centre = first.lens.rectify(body.pivot_px)
    return replace(
        first,
        status=body.status,
        regions=(None,) * len(body.status),
        smeared=np.zeros(len(body.status), bool),
        pivot=PivotEstimate(centre, J @ body.pivot_covariance_px2 @ J.T, "centre of rotation"),
        marker=None,
        circle=None,
        moves=True,
        body=body,
        by="body",
        clear=True,
        colour_rgb=None,
        notes=(),
        turns=None,
        doubt=None,
        learnt=None,
        found=None,
        scatter=0.0,
    )
