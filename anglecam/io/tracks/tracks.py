"""Named points over the frames of a clip, independent of the program that tracked them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from anglecam.data.typing import Floats
from anglecam.errors import InputError

MOST_VALUES = 50_000_000
"""A file that claims to hold more numbers than this is not read: six points filmed for a day are fewer."""
_FARTHEST_PX = 1e6
"""A point with a larger coordinate counts as missing: no picture is that large."""


@dataclass(frozen=True)
class Tracks:
    """Points of one clip; a point that was not found is NaN."""

    path: Path
    individuals: tuple[str, ...]
    keypoints: tuple[str, ...]
    position_px: Floats
    """(frames, individuals, keypoints, 2) x to the right and y down, px, for every frame from the first."""
    likelihood: Floats
    """(frames, individuals, keypoints); NaN where none is stated, as for points that a person has set."""
    software: str = ""
    """Name of the program that tracked; `anglecam.io.tracks.files.read_tracks` sets it."""
    usual_limit: float = 0.0
    """That program's default for the likelihood below which a point counts as missing; set by the same function."""


@dataclass(frozen=True)
class Pair:
    """Mark and pivot of one individual; arrays over all frames of the tracks."""

    mark_px: Floats
    """(frames, 2) px; NaN where the point is missing or its likelihood too low."""
    pivot_px: Floats
    """(frames, 2) px; NaN likewise."""
    followed: str | None
    """Which individual was chosen, and in how many frames each shows both points; ``None`` if there is only one."""


def choose_pair(tracks: Tracks, mark: str, pivot: str, least: float) -> Pair:
    """Return two points of the individual that shows both of them in the most frames.

    Parameters
    ----------
    tracks : Tracks
        Tracks of one clip.
    mark, pivot : str
        Names of the points.
    least : float
        Likelihood below which a point counts as missing.

    Returns
    -------
    Pair
        With a line on the chosen individual, if there are several.

    Raises
    ------
    InputError
        If the file has no point of that name; the line lists those that it has.
    """
    for name in (mark, pivot):
        if name not in tracks.keypoints:
            raise InputError(f"{tracks.path}: no point {name} in it; it has {', '.join(tracks.keypoints)}")
    which = [tracks.keypoints.index(mark), tracks.keypoints.index(pivot)]
    position, likelihood = tracks.position_px[:, :, which], tracks.likelihood[:, :, which]
    with np.errstate(invalid="ignore"):
        good = (np.abs(position) < _FARTHEST_PX).all(axis=-1) & ~(likelihood < least)
    both = np.where(good[..., None], position, np.nan)
    frames = np.isfinite(both).all(axis=(2, 3)).sum(axis=0)
    best = int(np.argmax(frames))
    followed = None
    if len(tracks.individuals) > 1:
        counts = ", ".join(f"{name} {n}" for name, n in zip(tracks.individuals, frames, strict=True))
        followed = f"{tracks.individuals[best]} is followed: it shows {mark} and {pivot} most often ({counts} frames)"
    return Pair(both[:, best, 0], both[:, best, 1], followed)


def unique_in_order(names: Sequence[str]) -> tuple[str, ...]:
    """Return each name once, in the order of its first appearance."""
    return tuple(dict.fromkeys(names))
