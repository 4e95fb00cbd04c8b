"""The fine pass over a clip: the rotation of the body in every frame, by registering all that is rigid on it.

The film is read twice more: one reading keeps the frames from which the body's appearance is learnt, the other finds
the rotation in every frame, one frame at a time. So memory does not grow with the clip beyond what
`anglecam.video.film` keeps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from anglecam.camera.lens import Lens
from anglecam.data.typing import Flags, Floats, Image
from anglecam.video.film import Film
from anglecam.vision.image.noise import pixel_noise
from anglecam.vision.pivot.estimate import PivotEstimate
from anglecam.vision.registration.learn import learn_body
from anglecam.vision.registration.tiles import FrameView, motion_plane
from anglecam.vision.registration.turn import NO_TURN, BodyAppearance, TurnEstimate, find_turn, refine_doubtful_turn

_LEARNT = 120
"""Frames from which the body is learnt, at most."""
_BYTES = 300_000_000
"""Memory for these frames."""
_LEAST_LEARNT = 30
"""Frames from which the body is learnt, at least, where the clip has as many."""
_PER_POSE = 2
"""Frames taken of one pose, unless there are too few poses."""
_POSE = 0.001
"""Rotations closer than this are one pose, rad: a fifth of a pixel at the rim of a body of 200 px."""
_STACK = 15
"""Number of the learnt frames, evenly spaced over the rotations, that are superposed to find the rigid tiles."""
_FEWEST = 12
"""A body seen in fewer frames is not learnt."""
_YIELDING = 0.5
"""Of `BodyAppearance.absorbed_share`: 0.05 to 0.1 in clips of steps and swings, 0.8 in a swing of 70° with six frames
on the way. It is far below zero where the motion hardly determines the appearance."""
_UNKNOWN_LEVER = 0.05
"""Relative uncertainty of the lever arm, by the pivot's, from which on the body's own rotation has to determine it."""
_OWN_ROTATION_PX = 2.0
"""Least displacement, by its own rotation, of the body's parts against each other, px. Edges that are misplaced by
0.05 px change the lever arm by more than 2.5 % where it is less."""
_DOUBT_PX = 10.0
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
    film: Film, start: Start, lens: Lens, progress: Callable[[int, int], None] | None = None
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
    progress : callable, optional
        Called with (frames done, frames in all).

    Returns
    -------
    Registered or str
        The cause, in a few words, where the body cannot be registered or registration is no improvement.
    """
    n, known = len(start.turn), np.flatnonzero(np.isfinite(start.sigma))
    if len(known) < _FEWEST:
        return f"the mark is seen in {len(known)} frames only"
    plane = motion_plane(lens, film.size)
    planes = 1 if film.coarse_colour else 3
    most = int(np.clip(_BYTES // (planes * film.width * film.height), _FEWEST, _LEARNT))
    wanted = _spread_out(start.turn, known, most)
    views = [
        _frame_view(start, frame.index, frame.image)
        for frame in film.frames(brightness=film.coarse_colour)
        if frame.index in wanted and frame.image is not None
    ]
    by_turn = np.argsort([g.turn for g in views])
    stack = by_turn[np.unique(np.linspace(0, len(by_turn) - 1, _STACK).round().astype(int))]
    noise = pixel_noise([g.image for g in views])
    with threadpool_limits(limits=1, user_api="blas"):  # small systems, in which threads only wait for each other
        appearance = learn_body(views, [views[i] for i in stack], plane, start.pivot, noise)
    if appearance is None:
        return "too little of the body is rigid and has edges"
    turned = float(np.ptp([view.turn for view in views]))
    del views
    if abs(appearance.absorbed_share) > _YIELDING:
        return "the body is seen in too few poses, or too obliquely, to be learnt"
    if not _determines_its_lever(appearance, start.pivot, turned):
        return "the body is too small, and its path too short, to show how far its pivot is"
    apart = appearance.pivot_px - start.pivot.centre_px
    if apart @ np.linalg.solve(appearance.pivot_covariance_px2 + start.pivot.covariance_px2, apart) > _ASTRAY:
        return "the rigid part of the picture does not rotate about the pivot"
    centred = replace(start, pivots_px=start.pivots_px + apart)
    found, rows = [NO_TURN] * n, start.row.copy()
    before: Image | None = None
    for frame in film.frames(brightness=film.coarse_colour):
        i, image = frame.index, frame.image
        if i < n and np.isfinite(start.turn[i]) and image is not None:
            one = _frame_view(centred, i, image)
            if one.turn_per_row:
                # at the middle of the tiles an error of the speed has the least effect
                rows[i] = appearance.row_of_middle(one)
                one = replace(one, turn=one.turn + one.turn_per_row * (rows[i] - one.row), row=rows[i])
            if np.isnan(start.sigma[i]):
                one = refine_doubtful_turn(appearance, _going_on(one, found, i), _DOUBT_PX)
            found[i] = find_turn(appearance, one, before if frame.predicted else None)
        before = image
        if progress is not None:
            progress(i + 1, n)
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


def _frame_view(start: Start, i: int, image: Image) -> FrameView:
    covariance = None if start.pivot_covariance_px2 is None else start.pivot_covariance_px2[i]
    return FrameView(
        image, float(start.turn[i]), start.pivots_px[i], float(start.turn_per_row[i]), float(start.row[i]), covariance
    )


def _determines_its_lever(body: BodyAppearance, pivot: PivotEstimate, turned: float) -> bool:
    """Return whether the lever arm is known by the pivot, or the body's rotation by ``turned`` rad shows it."""
    lever = float(np.hypot(*(body.middle_px - pivot.centre_px)))
    known = float(np.sqrt(np.linalg.eigvalsh(pivot.covariance_px2)[-1])) < _UNKNOWN_LEVER * lever
    return known or body.extent_px * turned > _OWN_ROTATION_PX


def _going_on(view: FrameView, found: list[TurnEstimate], i: int) -> FrameView:
    """Return a view at the angle at which the motion of the two frames before would go on, if they are known."""
    ahead = 2.0 * found[i - 1].turn - found[i - 2].turn if i > 1 else np.nan
    return view if np.isnan(ahead) else replace(view, turn=ahead)


def _spread_out(turn: Floats, known: NDArray[np.intp], most: int) -> set[int]:
    """Choose frames evenly from all poses.

    All frames at rest show the body at the same position on the pixel grid. An appearance learnt from many of them fits
    them at any assumed rotation, and so does not determine their rotation.
    """
    mixed = np.random.default_rng(0).permutation(known)
    pose = np.round(turn[mixed] / _POSE).astype(np.int64)
    by_pose = np.argsort(pose, kind="stable")
    first = np.flatnonzero(np.diff(pose[by_pose], prepend=pose.min() - 1))
    rank = np.empty(len(mixed), np.int64)
    rank[by_pose] = np.arange(len(mixed)) - np.repeat(first, np.diff(first, append=len(mixed)))
    enough = max(int((rank < _PER_POSE).sum()), _LEAST_LEARNT)
    return set(mixed[np.argsort(rank, kind="stable")[: min(most, enough)]].tolist())


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
