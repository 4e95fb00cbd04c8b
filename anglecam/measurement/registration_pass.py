"""The fine pass over a clip: how the head is turned in every frame, from all that is rigid on it.

Two more readings of the file: one keeps the frames from which the head is learnt, the other finds its turn in every
frame, one frame at a time, so that memory does not grow with the clip beyond what `anglecam.video.film` keeps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from anglecam.camera.lens import Lens
from anglecam.data.typing import Floats, Image
from anglecam.video.film import Film
from anglecam.vision.image.noise import pixel_noise
from anglecam.vision.pivot.estimate import PivotEstimate
from anglecam.vision.registration.learn import learn_appearance
from anglecam.vision.registration.tiles import FrameView, choose_tiles, motion_plane
from anglecam.vision.registration.turn import NO_TURN, BodyAppearance, TurnEstimate, find_turn, refine_doubtful_turn

_LEARNT = 120
"""Frames from which the head is learnt, at most."""
_BYTES = 300_000_000
"""Memory for them."""
_LEAST_LEARNT = 30
"""And at least, as long as there are so many."""
_PER_POSE = 2
"""Frames of one pose, unless there are too few poses."""
_POSE = 0.001
"""Turns closer than this are one pose, rad: a fifth of a pixel at the rim of an ordinary head."""
_STACK = 15
"""Of those, spread evenly over the turns, that are laid over one another to see what is rigid."""
_FEWEST = 12
"""A head seen in fewer frames is not learnt."""
_FEWEST_TILES = 3
_YIELDING = 0.5
"""Of `BodyAppearance.absorbed_share`: 0.05 to 0.1 in clips of steps and swings, 0.8 in a nod of 70° with six frames on
the way."""
_DOUBT_PX = 10.0
"""How far off a guess may be."""
_AGREE = 4.0
"""Times its uncertainty that the coarse angle may typically be off the fine one: beyond, what was learnt is not what
carries the mouth."""
_ASTRAY = 13.8
"""99.9 % point of χ² with two degrees of freedom: a centre of rotation farther from where it was expected is none."""


@dataclass(frozen=True)
class Start:
    """Where the coarse measurement has the head; arrays of length n, a frame of the clip each."""

    turn: Floats
    """Counter-clockwise as seen, from some reference, rad; NaN where it is not known: such a frame is left alone."""
    sigma: Floats
    """Its standard uncertainty, rad; NaN where the turn is a guess that nothing is learnt from."""
    pivot: PivotEstimate
    """In the plane of motion."""
    pivots_px: Floats
    """(n, 2) where it is in each frame, where camera or base move, in the plane of motion, px."""
    turn_per_row: Floats
    """What the head turns while the shutter goes on by a row, rad."""
    row: Floats
    """Row of the picture to whose exposure ``turn`` refers."""
    wander_px2: Floats | None = None
    """(n, 2, 2) covariance of ``pivots_px`` against each other, px²; ``None`` where the camera stands still."""


@dataclass(frozen=True)
class Registered:
    """The head's turn in every frame; arrays of length n, NaN where it was not found."""

    turn: Floats
    """Counter-clockwise as seen, from the reference, rad."""
    noise: Floats
    """Standard uncertainty from the pixels' noise, rad."""
    pose: Floats
    """Standard uncertainty that all frames share in which the head is at the same place, rad."""
    pivot_sensitivity: Floats
    """(n, 2) change of the turn with an error of the pivot, rad/px."""
    row: Floats
    """Row of the picture to whose exposure the turn refers."""
    pivot_px: Floats
    """(2,) centre of rotation as the whole head has it, px."""
    pivot_covariance_px2: Floats
    """(2, 2) px²."""
    look: BodyAppearance
    """What was learnt."""

    @property
    def sigma(self) -> Floats:
        """Standard uncertainty of each turn, rad."""
        return np.asarray(np.hypot(self.noise, self.pose))


def register_clip(
    film: Film, start: Start, lens: Lens, progress: Callable[[int, int], None] | None = None
) -> Registered | str:
    """Find the head's turn in every frame.

    Where colour is stored at a lower resolution than brightness, brightness alone is looked at: edges of colour then
    lie up to half a pixel beside it.

    Parameters
    ----------
    film : Film
        The clip.
    start : Start
        Where the head is, coarsely.
    lens : Lens
        From the picture to the plane of motion.
    progress : callable, optional
        Called with (frames done, frames in all).

    Returns
    -------
    Registered or str
        Why not, in a few words, where the head cannot be registered or is no better for it.
    """
    n, known = len(start.turn), np.flatnonzero(np.isfinite(start.sigma))
    if len(known) < _FEWEST:
        return f"the mouth is seen in {len(known)} frames only"
    plane = motion_plane(lens, film.size)
    planes = 1 if film.coarse_colour else 3
    most = int(np.clip(_BYTES // (planes * film.width * film.height), _FEWEST, _LEARNT))
    wanted = _spread_out(start.turn, known, most)
    glimpses = [
        _glimpse(start, frame.index, frame.image)
        for frame in film.frames(brightness=film.coarse_colour)
        if frame.index in wanted and frame.image is not None
    ]
    by_turn = np.argsort([g.turn for g in glimpses])
    stack = by_turn[np.unique(np.linspace(0, len(by_turn) - 1, _STACK).round().astype(int))]
    tiles = choose_tiles(
        [glimpses[i] for i in stack], plane, start.pivot.centre_px, pixel_noise([g.image for g in glimpses])
    )
    if len(tiles.corners) < _FEWEST_TILES:
        return "too little of the head is rigid and has edges"
    with threadpool_limits(limits=1, user_api="blas"):  # small systems: threads only wait for one another
        look = learn_appearance(glimpses, tiles, plane, start.pivot)
    del glimpses
    if look.absorbed_share > _YIELDING:
        return "the head is seen in too few poses, or at too much of a slant, to be learnt"
    apart = look.pivot_px - start.pivot.centre_px
    if apart @ np.linalg.solve(look.pivot_covariance_px2 + start.pivot.covariance_px2, apart) > _ASTRAY:
        return "what is rigid in the picture does not turn about the pivot"
    centred = replace(start, pivots_px=start.pivots_px + apart)
    found, rows = [NO_TURN] * n, start.row.copy()
    before: Image | None = None
    for frame in film.frames(brightness=film.coarse_colour):
        i, image = frame.index, frame.image
        if i < n and np.isfinite(start.turn[i]) and image is not None:
            one = _glimpse(centred, i, image)
            if one.turn_per_row:
                # at the middle of what is looked at, an error of the speed counts least
                rows[i] = look.row_of_middle(one)
                one = replace(one, turn=one.turn + one.turn_per_row * (rows[i] - one.row), row=rows[i])
            if np.isnan(start.sigma[i]):
                one = refine_doubtful_turn(look, one, _DOUBT_PX)
            found[i] = find_turn(look, one, before if frame.predicted else None)
        before = image
        if progress is not None:
            progress(i + 1, n)
    registered = _gathered(found, rows, look)
    both = np.isfinite(registered.turn) & np.isfinite(start.sigma)
    if not both.any() or np.median(registered.sigma[both]) > np.median(start.sigma[both]):
        return "the mouth alone is more certain than the head"
    off = registered.turn[both] - start.turn[both] - (start.turn_per_row * (rows - start.row))[both]
    if np.median(np.abs(off - np.median(off))) > _AGREE * np.median(start.sigma[both]):
        return "what is rigid in the picture does not turn with the mouth"
    return registered


def _glimpse(start: Start, i: int, image: Image) -> FrameView:
    wander = None if start.wander_px2 is None else start.wander_px2[i]
    return FrameView(
        image, float(start.turn[i]), start.pivots_px[i], float(start.turn_per_row[i]), float(start.row[i]), wander
    )


def _spread_out(turn: Floats, known: NDArray[np.intp], most: int) -> set[int]:
    """Choose frames from every pose alike.

    Frames at rest all show the head in the same place within the pixels: a look that is learnt from many of them
    agrees with them wherever they are thought to be, and never finds out how they are turned.
    """
    mixed = np.random.default_rng(0).permutation(known)
    pose = np.round(turn[mixed] / _POSE).astype(np.int64)
    by_pose = np.argsort(pose, kind="stable")
    first = np.flatnonzero(np.diff(pose[by_pose], prepend=pose.min() - 1))
    rank = np.empty(len(mixed), np.int64)
    rank[by_pose] = np.arange(len(mixed)) - np.repeat(first, np.diff(first, append=len(mixed)))
    enough = max(int((rank < _PER_POSE).sum()), _LEAST_LEARNT)
    return set(mixed[np.argsort(rank, kind="stable")[: min(most, enough)]].tolist())


def _gathered(found: list[TurnEstimate], rows: Floats, look: BodyAppearance) -> Registered:
    return Registered(
        turn=np.array([one.turn for one in found]),
        noise=np.array([one.noise for one in found]),
        pose=np.array([one.pose for one in found]),
        pivot_sensitivity=np.array([one.pivot_sensitivity for one in found]),
        row=rows,
        pivot_px=look.pivot_px,
        pivot_covariance_px2=look.pivot_covariance_px2,
        look=look,
    )
