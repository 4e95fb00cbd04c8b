"""Explanations of what moves compete on held-out frames; the best are fitted, and what they may be mistaken for too.

Every proposal is fitted to a small sample first. Those that predict best are fitted to the whole sample, one after the
other, until what is left is surely predicted better by what was fitted.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from anglecam.data.typing import Floats
from anglecam.engine.path import middle
from anglecam.engine.refine import Fit, refine
from anglecam.engine.sample import Sample, noise_of
from anglecam.engine.score import NOTHING, Proposal, Score, score
from anglecam.engine.sliding import slide_of
from anglecam.engine.target import turned

_FINALISTS = 4
"""Proposals that are fitted to the whole sample."""
SURE = 12.0
"""Standard errors by which a body that turns has to predict better than its rivals."""
RIGHT = 0.33
"""Least share of what it would gain over them if it were right. Both were set on 50 films in which nothing turns, of
`benchmarks.hostile`, on drawn ones of seeds 700 to 765, and on real films. Of the first, and less than 3 % off a turn
about one centre, snow has 8.7 standard errors, a cart 9.9, a spring 10.1; only an ellipse, 13.8, has more, and then
jumps. Their shares are 0.47 to 0.74 and hold none of them back; wrong bodies in drawn films have up to 24.7 and 0.38,
but a right one predicts better there. Of 36 bodies in drawn films that are followed rightly, 34 have more than 30; the
others have 14.4 and 10.1. Of real films the least have 13.8 and 0.37, 15.5 and 0.66, 32.5 and 0.71, 38 and 0.39.
In 20 films of the seeds 766 to 799, on which neither was set, no wrong body wins.
"""
OFF_CENTRE = 0.03
"""Share of its travel by which a body may be off a turn about one centre; its angle is then off by as much."""
LEAST_TURN = np.radians(1.0)
"""A body that is seen to turn by less may as well stretch or be seen through moving air."""
_APART_PX = 3.0
"""Of the sample: places of one body by two explanations that are the same."""


@dataclass(frozen=True)
class Explanation:
    """A body that turns, and how well it predicts frames that it was not learnt from."""

    fit: Fit
    score: Score
    lead: float
    """By how much it predicts better than what it may be mistaken for, in standard errors, the least of them: nothing
    moves, or a body moves along a straight line and does not turn."""
    share: float
    """Of what it would gain over these if it were right, the least."""

    @property
    def turns(self) -> bool:
        """Whether it is a body that turns about one centre."""
        turned = float(np.ptp(self.fit.proposal.turn[self.fit.seen]))
        return self.lead >= SURE and self.share >= RIGHT and self.fit.off_centre <= OFF_CENTRE and turned >= LEAST_TURN


def compete(sample: Sample, proposals: Sequence[Proposal], declared: Sequence[Proposal] = ()) -> list[Explanation]:
    """Return the explanations of a sample, the surest first.

    Parameters
    ----------
    sample : Sample
        K frames.
    proposals : sequence of Proposal
        Many, of which most are wrong.
    declared : sequence of Proposal
        From what somebody declares: the best of them are fitted to the whole sample whatever else is found.
    """
    small = halved(sample)
    # a hint adds to what is found without one, and to what that is compared with it adds nothing
    finalists = _fitted(sample, small, _in_order(small, proposals), _FINALISTS)
    pointed_at = _fitted(sample, small, _in_order(small, declared), _FINALISTS // 2, finalists, declared=True)
    rivals = [score(sample, NOTHING, [None] * len(sample.pictures))]
    found: list[Explanation] = []
    for fits in (finalists, pointed_at):
        rivals += [slide_of(sample, fit).score for fit in fits]
        found += [_compared(fit, score(sample, fit.proposal.name, fit.proposal.poses(sample)), rivals) for fit in fits]
    return sorted(found, key=lambda one: (not one.turns, -one.score.total if one.turns else -one.lead))


def _compared(fit: Fit, mine: Score, rivals: Sequence[Score]) -> Explanation:
    leads = [mine.over(rival) for rival in rivals]
    return Explanation(fit, mine, min(one.errors for one in leads), min(one.share for one in leads))


def _in_order(small: Sample, proposals: Sequence[Proposal]) -> list[tuple[Score, Proposal]]:
    """Return proposals that are fitted to a small sample, and how well they predict it, the best first."""
    still = score(small, NOTHING, [None] * len(small.pictures))
    rough: list[tuple[Score, Proposal]] = []
    for proposal in proposals:
        fit = refine(small, proposal.every_other(), 1, lit=False)
        if fit is not None:
            better = replace(proposal, centre_px=fit.proposal.centre_px, turn=_all_turns(proposal, fit))
            rough.append((score(small, proposal.name, fit.proposal.poses(small)), better))
    # what explains much of a few frames, and what explains a little of all
    most = np.argsort([-one.total for one, _ in rough], kind="stable").tolist()
    surest = np.argsort([-one.lead(still) for one, _ in rough], kind="stable").tolist()
    return [rough[k] for k in dict.fromkeys(itertools.chain.from_iterable(zip(most, surest, strict=True)))]


def _fitted(
    sample: Sample,
    small: Sample,
    order: Sequence[tuple[Score, Proposal]],
    most: int,
    taken: Sequence[Fit] = (),
    *,
    declared: bool = False,
) -> list[Fit]:
    """Return the first proposals, fitted to a sample, that differ from each other and from those that are taken.

    A proposal is not fitted where a body that turns about one centre surely predicts its pixels of the small sample
    better, unless it is declared.
    """
    found, better = list[Fit](), list[Score]()
    surest = np.arange(0, len(sample.pictures), 2)
    for rough, proposal in order:
        if len(found) == most:
            break
        known = any(_alike(sample, proposal, fit.proposal) for fit in (*taken, *found))
        if known or any(rough.lead(one) <= -SURE for one in better):
            continue
        fit = refine(sample, proposal, surest=surest)
        if fit is not None:
            found.append(fit)
            if fit.off_centre <= OFF_CENTRE and not declared:
                better.append(score(small, proposal.name, fit.proposal.every_other().poses(small)))
    return found


def halved(sample: Sample) -> Sample:
    """Return every other frame of a sample at half its size."""
    pictures = np.stack([cv2.pyrDown(picture) for picture in sample.pictures[::2]])
    # a pixel of the reduced picture lies on every other pixel of the first one
    corner = sample.corner_px + 0.5 / sample.scale - 0.5 * 2.0 / sample.scale
    return Sample(
        pictures, sample.frames[::2], sample.scale / 2.0, corner, noise_of(pictures), np.median(pictures, axis=0)
    )


def _all_turns(proposal: Proposal, fit: Fit) -> Floats:
    """Return the turns of a proposal with those of every other frame as they were fitted."""
    turn, fitted = proposal.turn.copy(), fit.proposal.turn
    both = np.isfinite(turn[::2]) & np.isfinite(fitted)
    turn -= middle(turn[::2][both] - fitted[both]) if both.any() else 0.0
    turn[::2] = np.where(np.isfinite(fitted), fitted, turn[::2])
    return turn


def _alike(sample: Sample, one: Proposal, other: Proposal) -> bool:
    """Return whether two proposals move what turns about the first one's centre to the same places."""
    both = np.isfinite(one.in_film() + other.in_film()).all(axis=(1, 2))
    if both.sum() < 4:
        return False
    seen = [replace(p, turn=np.where(both, p.turn, np.nan)) for p in (one, other)]
    height, width = sample.pictures.shape[1:]
    corners = np.array([[0.25, 0.25], [0.75, 0.25], [0.25, 0.75], [0.75, 0.75]]) * [width, height]
    first, second = (np.stack([pose for pose in p.poses(sample) if pose is not None]) for p in seen)
    base = middle(one.turn[both] - other.turn[both])
    back = turned(sample.place(other.centre_px), base)
    placed = corners @ first[:, :, :2].swapaxes(1, 2) + first[:, None, :, 2]
    moved = (corners @ back[:, :2].T + back[:, 2]) @ second[:, :, :2].swapaxes(1, 2) + second[:, None, :, 2]
    return float(np.median(np.hypot(*np.moveaxis(placed - moved, -1, 0)))) < _APART_PX
