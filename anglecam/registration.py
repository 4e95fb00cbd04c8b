"""The fine pass over a clip: how the head is turned in every frame, from all that is rigid on it.

Two more readings of the file: one keeps the frames from which the head is learnt, the other finds its turn in every
frame, one frame at a time, so that memory does not grow with the clip.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from anglecam.video.frames import read_frames
from anglecam.vision.pivot import Pivot
from anglecam.vision.register import Glimpse, Look, choose_tiles, find_turn, learn

Floats = NDArray[np.float64]

_LEARNT = 120
"""Frames from which the head is learnt, at most."""
_BYTES = 300_000_000
"""Memory for them."""
_STACK = 15
"""Of those, spread evenly over the turns, that are laid over one another to see what is rigid."""
_FEWEST = 12
"""A head seen in fewer frames is not learnt."""
_FEWEST_TILES = 3
_AGREE = 4.0
"""Times its uncertainty that the coarse angle may typically be off the fine one: beyond, what was learnt is not what
carries the mouth."""


@dataclass(frozen=True)
class Registered:
    """The head's turn in every frame; arrays of length n, NaN where it was not found."""

    turn: Floats
    """Counter-clockwise as seen, from the reference, rad."""
    noise: Floats
    """Standard uncertainty from the pixels' noise, rad."""
    pose: Floats
    """Standard uncertainty that all frames share in which the head is at the same place, rad."""
    pull: Floats
    """(n, 2) change of the turn with an error of the pivot, rad/px."""
    pivot_px: Floats
    """(2,) centre of rotation as the whole head has it, px."""
    pivot_covariance_px2: Floats
    """(2, 2) px²."""
    look: Look
    """What was learnt."""

    @property
    def sigma(self) -> Floats:
        """Standard uncertainty of each turn, rad."""
        return np.asarray(np.hypot(self.noise, self.pose))


def register_clip(
    path: Path,
    turn: Floats,
    sigma: Floats,
    pivot: Pivot,
    noise: float,
    coarse_colour: bool,
    progress: Callable[[int, int], None] | None = None,
) -> Registered | str:
    """Find the head's turn in every frame.

    Parameters
    ----------
    path : Path
        The clip.
    turn : ndarray
        (n,) coarse turn, rad; NaN where the mouth was not found: such a frame is left alone.
    sigma : ndarray
        (n,) its standard uncertainty, rad.
    pivot : Pivot
        Where the mechanism turns.
    noise : float
        Standard deviation of the pixels, grey levels.
    coarse_colour : bool
        Whether colour is stored at a lower resolution than brightness. Such codecs err alike all over the head, which
        the tiles cannot tell: measured, the uncertainty then comes out up to two times too small, so they are refused.
    progress : callable, optional
        Called with (frames done, frames in all).

    Returns
    -------
    Registered or str
        Why not, in a few words, where the head cannot be registered or is no better for it.
    """
    if coarse_colour:
        return "colour is stored at half resolution"
    known = np.flatnonzero(np.isfinite(turn))
    if len(known) < _FEWEST:
        return f"the mouth is seen in {len(known)} frames only"
    glimpses = _glimpses(path, turn, known, pivot)
    order = np.argsort([g.turn for g in glimpses])
    spread = order[np.unique(np.linspace(0, len(order) - 1, _STACK).round().astype(int))]
    tiles = choose_tiles([glimpses[i] for i in spread], noise)
    if len(tiles) < _FEWEST_TILES:
        return "too little of the head is rigid and has edges"
    look = learn(glimpses, tiles, pivot.covariance_px2)
    del glimpses
    found, noises, poses = (np.full(len(turn), np.nan) for _ in range(3))
    pulls = np.full((len(turn), 2), np.nan)
    for frame in read_frames(path):
        if frame.index < len(turn) and np.isfinite(turn[frame.index]) and frame.image is not None:
            one = find_turn(look, Glimpse(frame.image, float(turn[frame.index]), look.pivot_px))
            found[frame.index], pulls[frame.index] = one.turn, one.pull
            noises[frame.index], poses[frame.index] = one.noise, one.pose
        if progress is not None:
            progress(frame.index + 1, len(turn))
    both = np.isfinite(found)
    if not both.any() or np.median(np.hypot(noises, poses)[both]) > np.median(sigma[both]):
        return "the mouth alone is more certain than the head"
    apart = found[both] - turn[both]
    apart -= np.median(apart)
    if np.median(np.abs(apart)) > _AGREE * np.median(sigma[both]):
        return "what is rigid in the picture does not turn with the mouth"
    return Registered(found, noises, poses, pulls, look.pivot_px, look.pivot_covariance_px2, look)


def _glimpses(path: Path, turn: Floats, known: NDArray[np.int64], pivot: Pivot) -> list[Glimpse]:
    """Read frames whose turns are spread over all that there are, and over the clip."""
    first = next(frame.image for frame in read_frames(path) if frame.image is not None)
    most = int(np.clip(_BYTES // first.nbytes, _FEWEST, _LEARNT))
    by_turn = known[np.argsort(turn[known], kind="stable")]
    half = np.unique(np.linspace(0, len(known) - 1, max(most // 2, 2)).round().astype(int))
    wanted = set(by_turn[half].tolist()) | set(known[half].tolist())
    return [
        Glimpse(frame.image, float(turn[frame.index]), pivot.centre_px)
        for frame in read_frames(path)
        if frame.index in wanted and frame.image is not None
    ]
