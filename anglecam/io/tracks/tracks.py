"""Named points over the frames of a film, as trackers write them; nothing here knows which tracker it was."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from anglecam.data.typing import Floats
from anglecam.errors import InputError

MOST_VALUES = 50_000_000
"""A file that says it holds more numbers than this is not read: a day of film with six points has fewer."""
_FARTHEST_PX = 1e6
"""No picture is that large: what lies beyond is no place."""


@dataclass(frozen=True)
class Tracks:
    """Points of one film; a point that was not found is NaN."""

    path: Path
    software: str
    """Who tracked: ``DeepLabCut`` or ``SLEAP``."""
    individuals: tuple[str, ...]
    keypoints: tuple[str, ...]
    position_px: Floats
    """(frames, individuals, keypoints, 2) x to the right and y down, px, a row for every frame from the first."""
    likelihood: Floats
    """(frames, individuals, keypoints); NaN where none is stated, as for points that a person has set."""
    usual_limit: float
    """The likelihood below which this program's own default leaves a point out."""


@dataclass(frozen=True)
class Pair:
    """Two points of one individual; arrays over all frames of the tracks."""

    mark_px: Floats
    """(frames, 2) NaN where missing or not likely enough."""
    pivot_px: Floats
    """(frames, 2)."""
    followed: str | None
    """Which of several individuals it is, and how often each is there; ``None`` where there is but one."""


def choose_pair(tracks: Tracks, mouth: str, pivot: str, least: float) -> Pair:
    """Take two points out of tracks, of the individual that shows both of them in the most frames.

    Parameters
    ----------
    tracks : Tracks
        One film's.
    mouth, pivot : str
        Names of the points.
    least : float
        Likelihood below which a point counts as missing.

    Returns
    -------
    Pair
        With a line on the choice, where there was one.

    Raises
    ------
    InputError
        Where a point of that name is not in the file; the line lists those that are.
    """
    for name in (mouth, pivot):
        if name not in tracks.keypoints:
            raise InputError(f"{tracks.path}: no point {name} in it; it has {', '.join(tracks.keypoints)}")
    which = [tracks.keypoints.index(mouth), tracks.keypoints.index(pivot)]
    places, likelihood = tracks.position_px[:, :, which], tracks.likelihood[:, :, which]
    with np.errstate(invalid="ignore"):
        good = (np.abs(places) < _FARTHEST_PX).all(axis=-1) & ~(likelihood < least)
    both = np.where(good[..., None], places, np.nan)
    there = np.isfinite(both).all(axis=(2, 3)).sum(axis=0)
    best = int(np.argmax(there))
    followed = None
    if len(tracks.individuals) > 1:
        counts = ", ".join(f"{name} {n}" for name, n in zip(tracks.individuals, there, strict=True))
        followed = f"{tracks.individuals[best]} is followed: it shows {mouth} and {pivot} most often ({counts} frames)"
    return Pair(both[:, best, 0], both[:, best, 1], followed)


def unique_in_order(names: Sequence[str]) -> tuple[str, ...]:
    """Return each name once, in the order of its first appearance."""
    return tuple(dict.fromkeys(names))
