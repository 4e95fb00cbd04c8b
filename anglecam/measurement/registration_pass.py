"""The fine pass over a clip: the rotation of the body in every frame, by registering all that is rigid on it.

The film is read twice: one reading keeps the frames from which the body's appearance is learnt, the other finds the
rotation in every frame, one frame at a time. So memory does not grow with the clip beyond what `anglecam.video.film`
keeps. What was found in an earlier reading (`anglecam.measurement.body_ahead`) is taken over.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from anglecam.camera.lens import Lens
from anglecam.data.typing import Flags, Floats, Image
from anglecam.measurement.body_ahead import BodyAhead, TurnsAhead
from anglecam.measurement.body_learning import FEWEST, learn_from_frames, spread_out
from anglecam.progress import Progress, Stage, counted, unseen, watched
from anglecam.video.film import Film
from anglecam.vision.pivot.estimate import PivotEstimate
from anglecam.vision.registration.tiles import FrameView, motion_plane
from anglecam.vision.registration.turn import NO_TURN, BodyAppearance, TurnEstimate, find_turn, refine_doubtful_turn

_AS_MANY, _AS_WELL_KNOWN = 2.0, 2.0
"""Largest ratio of the poses that the whole film offers to those that a body was learnt from before, and of the
uncertainty of that body's pivot to that of the pivot by the mark's whole path."""
DOUBT_PX = 10.0
"""Largest error of a guessed rotation, px at the mark."""
_AGREE = 4.0
"""Limit of the median difference between coarse and fine rotation, in standard uncertainties of the coarse one. Beyond
it, the body that was learnt is not the one that carries the mark."""
_ASTRAY = 13.8
"""99.9 % point of χ² with two degrees of freedom: a centre of rotation farther from the pivot is rejected."""


@dataclass(frozen=True)
class Start:
    """Rotation of the body by the coarse pass; arrays of length n, an entry a frame of the clip."""

    turn: Floats
    """Counter-clockwise as seen, from an arbitrary reference, rad; NaN where unknown: such a frame is skipped."""
    sigma: Floats
    """Standard uncertainty of ``turn``, rad; NaN where ``turn`` is a guess, from which nothing is learnt."""
    pivot: PivotEstimate
    """In the plane of motion."""
    pivots_px: Floats
    """(n, 2) position of the pivot in each frame, in the plane of motion, px; it varies where the camera moves."""
    turn_per_row: Floats
    """Rotation of the body during the exposure delay of one row, rad."""
    row: Floats
    """Row of the picture at whose exposure ``turn`` holds."""
    pivot_covariance_px2: Floats | None = None
    """(n, 2, 2) covariance of ``pivots_px`` between frames, px²; ``None`` where the camera stands still."""


@dataclass(frozen=True)
class Registered:
    """Rotation of the body in every frame; arrays of length n, NaN where it was not found."""

    turn: Floats
    """Counter-clockwise as seen, from the reference, rad."""
    noise: Floats
    """Standard uncertainty due to the pixels' noise, rad."""
    pose: Floats
    """Standard uncertainty shared by all frames of the same pose, rad."""
    pivot_sensitivity: Floats
    """(n, 2) derivative of the rotation with respect to the pivot's position, rad/px."""
    misfit: Floats
    """Median misfit of the body's parts, relative to the usual one; infinite where it was not found."""
    clear: Flags
    """(n, tiles) which parts of the body are visible."""
    row: Floats
    """Row of the picture at whose exposure ``turn`` holds."""
    pivot_px: Floats
    """(2,) centre of rotation estimated from the whole body, px."""
    pivot_covariance_px2: Floats
    """(2, 2) of the centre through which the rotations depend on the pivot, px²."""
    appearance: BodyAppearance
    """The appearance that was learnt."""

    @property
    def sigma(self) -> Floats:
        """(n,) standard uncertainty of ``turn``, rad."""
        return np.asarray(np.hypot(self.noise, self.pose))


def register_clip(
    film: Film,
    start: Start,
    lens: Lens,
    progress: Progress = unseen,
    ahead: TurnsAhead | None = None,
) -> Registered | str:
    """Find the rotation of the body in every frame.

    Where colour is stored at a lower resolution than brightness, only the brightness is used, because edges of colour
    are then displaced by up to half a pixel.

    Parameters
    ----------
    film : Film
        The clip.
    start : Start
        From the coarse pass.
    lens : Lens
        From the picture to the plane of motion.
    progress : Progress
        Called with each stage, and after each frame.
    ahead : TurnsAhead, optional
        The rotations by a body that was learnt before.

    Returns
    -------
    Registered or str
        The cause, in a few words, where the body cannot be registered or registration is no improvement.
    """
    n, known = len(start.turn), np.flatnonzero(np.isfinite(start.sigma))
    if len(known) < FEWEST:
        return f"the mark is seen in {len(known)} frames only"
    wanted = spread_out(start.turn, known, film)
    found, left = [NO_TURN] * n, np.isfinite(start.turn)
    if ahead is not None and _serves(ahead.body, start.pivot, len(wanted)):
        appearance: BodyAppearance | str = ahead.body.appearance
        found, settled, reference = ahead.in_turns_of(np.where(np.isfinite(start.sigma), start.turn, np.nan))
        left &= ~settled
        start = replace(start, turn=start.turn + reference)
    else:
        shown = film.frames(brightness=film.coarse_colour, only=wanted)
        views = [
            _frame_view(start, frame.index, frame.image)
            for frame in watched(shown, progress, "reading pictures to learn how the body looks", len(wanted))
            if frame.image is not None
        ]
        progress(Stage("learning how the body looks"))
        appearance = learn_from_frames(views, motion_plane(lens, film.size), start.pivot)
        del views
    if isinstance(appearance, str):
        return appearance
    apart = appearance.pivot_px - start.pivot.centre_px
    if apart @ np.linalg.solve(appearance.pivot_covariance_px2 + start.pivot.covariance_px2, apart) > _ASTRAY:
        return "the rigid part of the picture does not rotate about the pivot"
    rows = _find_turns(film, appearance, replace(start, pivots_px=start.pivots_px + apart), left, found, progress)
    registered = _gathered(found, rows, appearance)
    if lens.neglects_perspective:
        displaced = lens.neglected_displacement(
            float(np.hypot(*(appearance.middle_px - appearance.pivot_px))), film.width
        )
        covariance = registered.pivot_covariance_px2 + np.outer(displaced, displaced)
        registered = replace(registered, pivot_covariance_px2=covariance)
    both = np.isfinite(registered.turn) & np.isfinite(start.sigma)
    if not both.any() or np.median(registered.sigma[both]) > np.median(start.sigma[both]):
        return "the mark alone is more certain than the body"
    off = registered.turn[both] - start.turn[both] - (start.turn_per_row * (rows - start.row))[both]
    if np.median(np.abs(off - np.median(off))) > _AGREE * np.median(start.sigma[both]):
        return "the rigid part of the picture does not rotate with the mark"
    return registered


def _serves(body: BodyAhead, pivot: PivotEstimate, poses: int) -> bool:
    """Return whether a body learnt from some frames is as good as one learnt with all that the whole film shows."""
    known, learnt = (
        float(np.linalg.eigvalsh(C)[-1]) for C in (pivot.covariance_px2, body.appearance.pivot_covariance_px2)
    )
    return learnt <= _AS_WELL_KNOWN**2 * known and _AS_MANY * body.poses >= poses


def _find_turns(
    film: Film,
    appearance: BodyAppearance,
    start: Start,
    wanted: Flags,
    found: list[TurnEstimate],
    progress: Progress,
) -> Floats:
    """Find the rotation in the wanted frames, and write it; return the rows (n,) at whose exposure it holds."""
    n, rows = len(start.turn), start.row.copy()
    if not wanted.any():
        return rows
    indices = np.flatnonzero(wanted)
    before: Image | None = None
    done = counted(progress, "measuring the whole body", n)
    for frame in film.frames(brightness=film.coarse_colour, only={*indices.tolist(), *(indices - 1).tolist()}):
        i, image = frame.index, frame.image
        if i < n and wanted[i] and image is not None:
            one = _frame_view(start, i, image)
            if one.turn_per_row:
                # at the middle of the tiles an error of the speed has the least effect
                rows[i] = appearance.row_of_middle(one)
                one = replace(one, turn=one.turn + one.turn_per_row * (rows[i] - one.row), row=rows[i])
            if np.isnan(start.sigma[i]):
                one = refine_doubtful_turn(appearance, _going_on(one, found, i), DOUBT_PX)
            found[i] = find_turn(appearance, one, before if frame.predicted else None)
        before = image
        done(i + 1)
    return rows


def _frame_view(start: Start, i: int, image: Image) -> FrameView:
    covariance = None if start.pivot_covariance_px2 is None else start.pivot_covariance_px2[i]
    return FrameView(
        image, float(start.turn[i]), start.pivots_px[i], float(start.turn_per_row[i]), float(start.row[i]), covariance
    )


def _going_on(view: FrameView, found: list[TurnEstimate], i: int) -> FrameView:
    """Return a view at the angle at which the motion of the two frames before would go on, if they are known."""
    ahead = 2.0 * found[i - 1].turn - found[i - 2].turn if i > 1 else np.nan
    return view if np.isnan(ahead) else replace(view, turn=ahead)


def _gathered(found: list[TurnEstimate], rows: Floats, appearance: BodyAppearance) -> Registered:
    return Registered(
        turn=np.array([one.turn for one in found]),
        noise=np.array([one.noise for one in found]),
        pose=np.array([one.pose for one in found]),
        pivot_sensitivity=np.array([one.pivot_sensitivity for one in found]),
        misfit=np.array([one.misfit for one in found]),
        clear=np.array([one.clear if len(one.clear) else np.zeros(len(appearance.heights), bool) for one in found]),
        row=rows,
        pivot_px=appearance.pivot_px,
        pivot_covariance_px2=appearance.centre_covariance_px2,
        appearance=appearance,
    )
