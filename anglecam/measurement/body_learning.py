"""Learn the body's appearance from frames of a clip that show it in many poses."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from anglecam.data.typing import Floats
from anglecam.video.film import Film
from anglecam.vision.image.noise import pixel_noise
from anglecam.vision.pivot.estimate import PivotEstimate
from anglecam.vision.registration.learn import learn_body
from anglecam.vision.registration.tiles import FrameView, MotionPlane
from anglecam.vision.registration.turn import BodyAppearance

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
FEWEST = 12
"""A body seen in fewer frames is not learnt."""
_YIELDING = 0.5
"""Of `BodyAppearance.absorbed_share`: 0.05 to 0.4 in clips of steps and swings, 0.8 in a swing of 70° with six frames
on the way. Of two bodies with 0.5 to 0.75 one has an error of 1.7°, and the other, a glossy head, of 0.02°. It is far
below zero where the motion hardly determines the appearance."""
_UNKNOWN_LEVER = 0.05
"""Relative uncertainty of the lever arm, by the pivot's, from which on the body's own rotation has to determine it."""
_OWN_ROTATION_PX = 2.0
"""Least displacement, by its own rotation, of the body's parts against each other, px. Edges that are misplaced by
0.05 px change the lever arm by more than 2.5 % where it is less."""


def spread_out(turn: Floats, known: NDArray[np.intp], film: Film) -> set[int]:
    """Choose frames evenly from all poses, as many as a body is learnt from.

    All frames at rest show the body at the same position on the pixel grid. An appearance learnt from many of them fits
    them at any assumed rotation, and so does not determine their rotation.

    Parameters
    ----------
    turn : ndarray
        (n,) rotation in each frame, rad.
    known : ndarray
        Numbers of the frames in which it is known.
    film : Film
        Limits the number by the size of its pictures.

    Returns
    -------
    set of int
        Numbers of the chosen frames.
    """
    planes = 1 if film.coarse_colour else 3
    most = int(np.clip(_BYTES // (planes * film.width * film.height), FEWEST, _LEARNT))
    mixed = np.random.default_rng(0).permutation(known)
    pose = np.round(turn[mixed] / _POSE).astype(np.int64)
    by_pose = np.argsort(pose, kind="stable")
    first = np.flatnonzero(np.diff(pose[by_pose], prepend=pose.min() - 1))
    rank = np.empty(len(mixed), np.int64)
    rank[by_pose] = np.arange(len(mixed)) - np.repeat(first, np.diff(first, append=len(mixed)))
    enough = max(int((rank < _PER_POSE).sum()), _LEAST_LEARNT)
    return set(mixed[np.argsort(rank, kind="stable")[: min(most, enough)]].tolist())


def learn_from_frames(views: Sequence[FrameView], plane: MotionPlane, pivot: PivotEstimate) -> BodyAppearance | str:
    """Learn the body's appearance from frames in many poses; return the cause, in a few words, where it cannot be."""
    by_turn = np.argsort([view.turn for view in views])
    stack = by_turn[np.unique(np.linspace(0, len(by_turn) - 1, _STACK).round().astype(int))]
    noise = pixel_noise([view.image for view in views])
    with threadpool_limits(limits=1, user_api="blas"):  # small systems, in which threads only wait for each other
        appearance = learn_body(views, [views[i] for i in stack], plane, pivot, noise)
    if appearance is None:
        return "too little of the moving body is rigid and textured for the body itself to be measured"
    if abs(appearance.absorbed_share) > _YIELDING:
        return "the body is seen in too few poses, or too obliquely, to be learnt"
    if not _determines_its_lever(appearance, pivot, float(np.ptp([view.turn for view in views]))):
        return "the body is too small, and its path too short, to show how far its pivot is"
    return appearance


def _determines_its_lever(body: BodyAppearance, pivot: PivotEstimate, turned: float) -> bool:
    """Return whether the lever arm is known by the pivot, or the body's rotation by ``turned`` rad shows it."""
    lever = float(np.hypot(*(body.middle_px - pivot.centre_px)))
    known = float(np.sqrt(np.linalg.eigvalsh(pivot.covariance_px2)[-1])) < _UNKNOWN_LEVER * lever
    return known or body.extent_px * turned > _OWN_ROTATION_PX
