"""From the frames of a film to the body that turns in them: proposals, competition, and a closer look at the winner."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from anglecam.data.typing import Floats
from anglecam.engine.competition import Explanation, compete
from anglecam.engine.proposals import blobs, features, polar
from anglecam.engine.refine import Fit
from anglecam.engine.sample import Sample, Stills, sample_part, sample_stills
from anglecam.engine.score import Proposal
from anglecam.engine.target import turned
from anglecam.threads import one_opencv_thread

Finder = Callable[[Sample], list[Proposal]]
FINDERS: tuple[Finder, ...] = (blobs.proposals, features.proposals, polar.proposals)
_CLOSER = 1.3
"""Least enlargement for which the pictures are sampled again."""
_MARGIN = 0.1
"""Of the surroundings of what a body sweeps, as a share of its extent."""


@dataclass(frozen=True)
class Hints:
    """What somebody declares about the body; px of the film."""

    pivot_px: Floats | None = None
    """(2,) about where it turns."""
    pivot_sigma_px: float = 30.0
    """Standard uncertainty of each coordinate."""
    mark_px: Floats | None = None
    """(4,) box, left, top, right, bottom, that covers a part of it."""
    mark_frame: int = 0
    """In which frame of the film."""


NO_HINTS = Hints()


@dataclass(frozen=True)
class Learnt:
    """What moves in a film."""

    sample: Sample
    explanations: tuple[Explanation, ...]
    """The first, of the sample, is the most probable one that obeys the hints."""
    wider: Sample | None = None
    """That of the explanations after the first, where the first is seen closer."""

    @property
    def turns(self) -> bool:
        """Whether the first explanation is a body that turns about one centre."""
        return bool(self.explanations) and self.explanations[0].turns

    @property
    def lead(self) -> float:
        """By how much the first explanation predicts better than its rivals, in standard errors."""
        return self.explanations[0].lead if self.explanations else -np.inf


def learn(stills: Stills, hints: Hints = NO_HINTS) -> Learnt | None:
    """Find the body that turns in a film.

    Parameters
    ----------
    stills : Stills
        Frames of the film.
    hints : Hints
        What is declared.

    Returns
    -------
    Learnt or None
        ``None`` where nothing moves.
    """
    looked: list[Learnt] = []
    with one_opencv_thread(), threadpool_limits(1, "blas"):  # matrices this small take longer with more
        for sample in sample_stills(stills):
            looked.append(_explained(sample, stills, hints))
            if _rank(looked[-1], hints) == 0:
                break
    return min(looked, key=lambda one: (_rank(one, hints), -one.lead), default=None)


def _explained(sample: Sample, stills: Stills, hints: Hints) -> Learnt:
    proposals = [one for find in FINDERS for one in find(sample)]
    found = sorted(compete(sample, proposals), key=lambda one: _rank(Learnt(sample, (one,)), hints))
    if not found:
        return Learnt(sample, ())
    closer = sample_part(stills, swept(sample, found[0].fit))
    if closer is not None and closer.scale > _CLOSER * sample.scale:
        again = compete(closer, [found[0].fit.proposal.in_frames(sample.frames, closer.frames)])
        if again and (again[0].turns or not found[0].turns):
            return Learnt(closer, (again[0], *found[1:]), sample)
    return Learnt(sample, tuple(found))


def _rank(one: Learnt, hints: Hints) -> int:
    """Return 0 for a body that turns and obeys the hints, 1 for one that turns otherwise, 2 for none.

    A hint does not hide what turns: where nothing turns as it says, a message says what does.
    """
    if not one.turns:
        return 2
    return 0 if obeys(one.explanations[0], one.sample, hints) else 1


def obeys(one: Explanation, sample: Sample, hints: Hints) -> bool:
    """Return whether a body turns about the hinted pivot and is where it was pointed at."""
    if hints.pivot_px is not None:
        off = one.fit.proposal.centre_px - hints.pivot_px
        spread = one.fit.covariance_px2 + hints.pivot_sigma_px**2 * np.eye(2)
        if off @ np.linalg.solve(spread, off) > _FAR:
            return False
    if hints.mark_px is None:
        return True
    k = int(np.argmin(np.abs(sample.frames - hints.mark_frame)))
    turn = one.fit.proposal.turn[k]
    if sample.frames[k] != hints.mark_frame or not np.isfinite(turn):
        return True  # nothing contradicts it
    rows, columns = np.nonzero(one.fit.target.visibility)
    places = np.column_stack([columns, rows]) - float(one.fit.target.pad)
    pose = turned(sample.place(one.fit.proposal.centre_px), float(turn))
    there = sample.in_film(places @ pose[:, :2].T + pose[:, 2])
    there = np.vstack([there, one.fit.proposal.centre_px])  # a hub is not seen to turn
    slack = _BESIDE_PX / sample.scale
    low, high = hints.mark_px[:2] - slack, hints.mark_px[2:] + slack
    return bool(((there >= low) & (there <= high)).all(axis=1).any())


_FAR = 9.0
"""Squared standard uncertainties by which a hint may be off the centre: true hints are so in 1 % of all films."""
_BESIDE_PX = 3.0
"""Of the sample: by which a place that is pointed at may lie beside the body."""


def swept(sample: Sample, fit: Fit) -> Floats:
    """Return left, top, right, bottom of what a body covers in the frames, with a margin, px of the film."""
    rows, columns = np.nonzero(fit.target.visibility)
    places = np.column_stack([columns, rows]) - float(fit.target.pad)
    poses = [pose for pose in fit.proposal.poses(sample) if pose is not None]
    low = np.min([(places @ pose[:, :2].T + pose[:, 2]).min(axis=0) for pose in poses], axis=0)
    high = np.max([(places @ pose[:, :2].T + pose[:, 2]).max(axis=0) for pose in poses], axis=0)
    margin = max(4.0, _MARGIN * float((high - low).max()))
    return np.concatenate([sample.in_film(low - margin), sample.in_film(high + margin)])
