"""The coarse pass over a clip without a mark: find out what turns, and follow it through all frames."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from anglecam.camera.lens import lens_from_rig
from anglecam.data.series import OK
from anglecam.data.typing import Floats
from anglecam.engine.body import Turn
from anglecam.engine.hints import Hints
from anglecam.engine.kept_picture import in_grey_levels
from anglecam.engine.learn import Learnt, looks, rank
from anglecam.engine.path import unsteadiness
from anglecam.engine.reasons import why_ambiguous, why_another, why_jump, why_nothing_turns
from anglecam.engine.refine import sensitivities
from anglecam.engine.relearning import steadier
from anglecam.engine.sample import FRAMES
from anglecam.engine.target import Picture as Grey
from anglecam.engine.tint import tint_of
from anglecam.engine.tracking import Search, Track, candidates, chosen, search_for
from anglecam.io.rig import Rig
from anglecam.measurement.camera_pass import HeldCamera
from anglecam.measurement.detections import Detections, frame_of_mark
from anglecam.measurement.pivot import HINT_PX, find_pivot
from anglecam.measurement.rigid_motion import RigidMotion
from anglecam.measurement.seen_frames import Seen, follow, moving_stills, picture_of, stills_of
from anglecam.progress import Progress, Stage, unseen
from anglecam.video.film import Film
from anglecam.video.picture import Picture
from anglecam.vision.image.noise import pixel_noise
from anglecam.vision.pivot.circle import Circle
from anglecam.vision.status import AMBIGUOUS, OCCLUDED, UNDECODABLE

_STEADIER = 6
"""Rounds of learning a body again from a steadier motion, at most."""
_SHIFTED_PX = 0.05
"""By which light, a codec and interpolation shift an edge, px: 0.02 to 0.08 in MJPG films."""


def detect_body(camera: HeldCamera, rig: Rig, progress: Progress = unseen) -> Detections | str:
    """Find what turns in a clip, and its turn in every frame.

    Parameters
    ----------
    camera : HeldCamera
        The clip, and how its camera moves.
    rig : Rig
        Declares mark, pivot and camera.
    progress : Progress
        Called with each stage, and after each frame.

    Returns
    -------
    Detections or str
        Of a body; where nothing is seen to turn, a line with what was seen, and what can be declared.
    """
    film = camera.film
    progress(Stage("looking for what turns"))
    hints = hints_of(film, rig)
    pictures = moving_stills(film)
    if hints.mark_px is not None and all(picture.index != hints.mark_frame for picture in pictures):
        pictures = sorted([*pictures, picture_of(film, hints.mark_frame)], key=lambda picture: picture.index)
    looked: list[Learnt] = []
    doubtful: Detections | None = None
    for learnt in _looks(pictures, camera, hints):
        looked.append(learnt)
        if rank(learnt, hints) == 0:
            found = _followed(camera, rig, hints, learnt, progress)
            if isinstance(found, str) or found.doubt is None:
                return found  # a closer look does not tell like parts apart
            doubtful = doubtful or found
    if doubtful is not None:
        return doubtful
    best = min(looked, key=lambda one: (rank(one, hints), -one.lead), default=None)
    if best is None or not best.turns:
        return why_nothing_turns(best, film.first_frame)
    return _followed(camera, rig, hints, best, progress)


def _looks(pictures: list[Picture], camera: HeldCamera, hints: Hints) -> Iterator[Learnt]:
    """Look at pictures of a clip by their brightness, and then by their colour."""
    yield from looks(stills_of(pictures, camera), hints)
    tint = tint_of([image for picture in pictures if (image := picture.colours) is not None])
    if tint is not None:
        yield from looks(stills_of(pictures, camera, tint), hints)


def _followed(camera: HeldCamera, rig: Rig, hints: Hints, learnt: Learnt, progress: Progress) -> Detections | str:
    """Follow a body that was learnt through all frames; return why it cannot be followed otherwise."""
    film = camera.film
    search = search_for(learnt.sample, learnt.explanations[0].fit)
    seen = follow(camera, search.sample, partial(_candidates, search), progress)
    tried = [(search, seen, chosen(seen.found, seen.time, search))]
    while len(tried) <= _STEADIER and (again := steadier(search, seen.found, seen.time, seen.pictures)) is not None:
        search = again
        seen = _again(seen, again) or follow(camera, again.sample, partial(_candidates, again), progress)
        tried.append((search, seen, chosen(seen.found, seen.time, search)))
    # of motions that explain the film as well, the steadiest
    resolution = 1.0 / tried[0][0].arm
    search, seen, track = min(tried, key=lambda one: unsteadiness(one[2].turn, one[1].time, resolution))
    jump = why_jump(track.turn, film.first_frame)
    if jump is not None:
        return jump
    declared = hints if rig.pivot.at is not None else replace(hints, pivot_px=None)
    doubt = why_another(learnt, declared, film.first_frame) or why_ambiguous(track.ambiguous, film.first_frame)
    found = _detections(film, rig, seen, rigid_motion(search, track, seen.decoded))
    return found if isinstance(found, str) else replace(found, doubt=doubt, learnt=learnt)


def _candidates(search: Search, _: int, picture: Grey) -> list[Turn]:
    return candidates(search, picture)


def hints_of(film: Film, rig: Rig) -> Hints:
    """Return what a rig says about mark and pivot of a film; raises `InputError` if it has no such frame."""
    mark, pivot = rig.pointed_mark, rig.pivot
    if mark is not None:
        frame_of_mark(film, mark)  # it has to exist
    return Hints(
        pivot_px=None if pivot.expected is None else np.array(pivot.expected),
        pivot_sigma_px=HINT_PX if pivot.at is None else max(HINT_PX, pivot.sigma_px or 0.0),
        mark_px=None if mark is None else np.array(mark.as_box),
        mark_frame=0 if mark is None else mark.frame - film.first_frame,
    )


def _again(seen: Seen, search: Search) -> Seen | None:
    """Return what another search finds in the same pictures; ``None`` where they were not kept."""
    if not seen.pictures:
        return None
    found = [[] if p is None else candidates(search, in_grey_levels(p)) for p in seen.pictures]
    return replace(seen, found=found)


def rigid_motion(search: Search, track: Track, decoded: list[bool], carrier_turn: Floats | float = 0.0) -> RigidMotion:
    """Return the motion of a body that was followed in the n frames of a clip.

    Parameters
    ----------
    search : Search
        For the body.
    track : Track
        Its turns.
    decoded : list of bool
        Which frames could be decoded.
    carrier_turn : float or (n,) ndarray
        Turns of what carries the body's centre, rad.
    """
    fit, sample = search.fit, search.sample
    known = np.isfinite(track.turn)
    sensitivity, sigma = np.full((len(track.turn), 2), np.nan), track.sigma.copy()
    carried = np.broadcast_to(carrier_turn, known.shape)[known]
    sensitivity[known], shift = sensitivities(sample, fit, search.body, track.turn[known], carried)
    off_px = np.hypot(fit.off_px, _SHIFTED_PX / sample.scale)
    sigma[known] = np.hypot(sigma[known], np.hypot(*shift.T) / np.sqrt(2.0) * off_px)
    middle = float(np.median(track.turn[known])) if known.any() else 0.0
    arm = search.body.middle - search.centre
    cos, sin = np.cos(middle), np.sin(middle)
    centre = search.centre + np.array([cos * arm[0] + sin * arm[1], -sin * arm[0] + cos * arm[1]])
    status = [
        UNDECODABLE if not shown else AMBIGUOUS if vague else OK if ok else OCCLUDED
        for shown, vague, ok in zip(decoded, track.ambiguous, known, strict=True)
    ]
    return RigidMotion(
        turn=track.turn - middle,
        sigma=sigma,
        pivot_sensitivity=sensitivity,
        pivot_px=fit.proposal.centre_px,
        pivot_covariance_px2=fit.covariance_px2,
        centre_px=sample.in_film(centre),
        extent_px=search.body.reach / sample.scale,
        status=tuple(status),
    )


def _detections(film: Film, rig: Rig, seen: Seen, body: RigidMotion) -> Detections | str:
    sample = film.sample(FRAMES)
    images = [frame.image for frame in sample.frames if frame.image is not None]
    lens = lens_from_rig(rig, film.size, film.path)
    lever = float(np.hypot(*(body.centre_px - body.pivot_px)))
    covariance = np.pad(body.pivot_covariance_px2, (0, 1))
    covariance[2, 2] = np.trace(body.pivot_covariance_px2)
    # the turn of a body that is larger than its lever is seen on itself
    radius = max(lever, body.extent_px)
    turned = Circle(body.pivot_px, radius, 0.0, covariance, np.ones(len(seen.time), bool))
    marker, pivot, disagreement = find_pivot(images, rig, turned, lens)
    if OK not in body.status or pivot is None:
        return f"none of {len(seen.time)} frames shows what turns in the sampled ones"
    return Detections(
        time=seen.time,
        status=body.status,
        regions=(None,) * len(seen.time),
        smeared=np.zeros(len(seen.time), bool),
        pivot=pivot,
        marker=marker,
        circle=None,
        moves=True,
        lens=lens,
        camera_moves=tuple(seen.moves) or None,
        body=body,
        by="body",
        clear=True,
        noise=pixel_noise(images),
        repeated=np.array(seen.repeated),
        colour_rgb=None,
        size=film.size,
        truncated=film.why_truncated(sample),
        notes=("the body that turns is measured, without a mark", *([disagreement] if disagreement else [])),
    )
