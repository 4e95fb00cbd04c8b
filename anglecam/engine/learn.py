"""From the frames of a film to the body that turns in them: proposals, competition, and a closer look at the winner."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from anglecam.data.typing import Floats
from anglecam.engine.competition import Explanation, compete
from anglecam.engine.hints import NO_HINTS, Hints, beside_mark, obeys
from anglecam.engine.proposals import blobs, declared, features, polar
from anglecam.engine.refine import Fit
from anglecam.engine.sample import Sample, Stills, sample_part, sample_stills
from anglecam.engine.score import Proposal
from anglecam.threads import one_opencv_thread

Finder = Callable[[Sample], list[Proposal]]
FINDERS: tuple[Finder, ...] = (blobs.proposals, features.proposals, polar.proposals)
CLOSER = 1.3
"""Least enlargement for which the pictures are sampled again."""
_MARGIN = 0.1
"""Of the surroundings of what a body sweeps, as a share of its extent."""


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


def looks(stills: Stills, hints: Hints = NO_HINTS) -> Iterator[Learnt]:
    """Look for the body that turns in a film: at all that changes, then closer at parts of it.

    Parameters
    ----------
    stills : Stills
        Frames of the film.
    hints : Hints
        What is declared.

    Yields
    ------
    Learnt
        Of each look; none where nothing moves.
    """
    samples = sample_stills(stills, hints.around_mark_px)
    for n, sample in enumerate(samples):
        with one_opencv_thread(), threadpool_limits(1, "blas"):  # matrices this small take longer with more
            learnt = _explained(sample, samples[n + 1 :], stills, hints)
        yield learnt


def _explained(sample: Sample, parts: Sequence[Sample], stills: Stills, hints: Hints) -> Learnt:
    found = _competing(sample, hints)
    if not found:
        return Learnt(sample, ())
    proposal = found[0].fit.proposal
    closer = sample_part(stills, swept(sample, found[0].fit), hints.around_mark_px)
    if closer is not None and closer.scale > CLOSER * sample.scale:
        again = compete(closer, [proposal.in_frames(sample.frames, closer.frames)])
        if again and (again[0].turns or not found[0].turns):
            return Learnt(closer, (again[0], *found[1:]), sample)
    elif found[0].turns:
        # scenery that seems to turn along keeps the body's surroundings wide; a part of the picture may show it better
        for part in parts:
            if part.scale > CLOSER * sample.scale and _shows(part, proposal.centre_px):
                again = _competing(part, hints)
                if again and again[0].turns and again[0].lead > found[0].lead:
                    return Learnt(part, (again[0], *found[1:]), sample)
    return Learnt(sample, tuple(found))


def _competing(sample: Sample, hints: Hints) -> list[Explanation]:
    """Return the explanations of a sample, those that obey the hints first, and of these the one that is pointed at."""
    proposals = [one for find in FINDERS for one in find(sample)]
    fits = compete(sample, proposals, declared.proposals(sample, hints))
    return sorted(fits, key=lambda one: (rank(Learnt(sample, (one,)), hints), int(beside_mark(one.fit, sample, hints))))


def _shows(sample: Sample, point_px: Floats) -> bool:
    """Return whether a point (2,) of the film, px, lies in a sample."""
    place = sample.place(point_px)
    return bool((place >= 0.0).all() and (place < sample.median.shape[::-1]).all())


def rank(one: Learnt, hints: Hints) -> int:
    """Return 0 for a body that turns and obeys the hints, 1 for one that turns otherwise, 2 for none.

    A hint does not hide what turns: where nothing turns as it says, a message says what does.
    """
    if not one.turns:
        return 2
    return 0 if obeys(one.explanations[0].fit, one.sample, hints) else 1


def swept(sample: Sample, fit: Fit) -> Floats:
    """Return left, top, right, bottom of what a body covers in the frames, with a margin, px of the film."""
    rows, columns = np.nonzero(fit.target.visibility)
    places = np.column_stack([columns, rows]) - float(fit.target.pad)
    poses = [pose for pose in fit.proposal.poses(sample) if pose is not None]
    low = np.min([(places @ pose[:, :2].T + pose[:, 2]).min(axis=0) for pose in poses], axis=0)
    high = np.max([(places @ pose[:, :2].T + pose[:, 2]).max(axis=0) for pose in poses], axis=0)
    margin = max(4.0, _MARGIN * float((high - low).max()))
    return np.concatenate([sample.in_film(low - margin), sample.in_film(high + margin)])
