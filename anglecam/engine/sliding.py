"""What a body that turns may be mistaken for: one that moves along a straight line and does not turn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anglecam.data.typing import Floats
from anglecam.engine.body import body_of, frame_of
from anglecam.engine.refine import Fit
from anglecam.engine.sample import Sample
from anglecam.engine.score import Score, score
from anglecam.engine.target import learn_target, turned

_ROUNDS = 2
"""Of learning and locating in turn, as for a body that turns (`anglecam.engine.refine`)."""
_TRIED_PX = np.arange(-3.0, 3.5, 0.5)
"""Shifts along the line by which a place may be off."""


@dataclass(frozen=True)
class Slide:
    """A body that moves along a straight line and does not turn."""

    poses: list[Floats | None]
    """K maps (2, 3) from the coordinates of the body to the sample, px; ``None`` where it is not seen."""
    score: Score


def slide_of(sample: Sample, fit: Fit) -> Slide:
    """Return what predicts best of a body whose middle moves on the straight line that is nearest to a turning one's.

    Its places on the line are those of the turning body, or those at which the unturned body is most likely: the one
    explanation must not be worse than the other only because the other was fitted.
    """
    poses = fit.proposal.poses(sample)
    rows, columns = np.nonzero(fit.target.visibility)
    middle = np.array([columns.mean(), rows.mean()]) - fit.target.pad
    shifts = np.array([np.full(2, np.nan) if p is None else p[:, :2] @ middle + p[:, 2] - middle for p in poses])
    known = np.isfinite(shifts[:, 0])
    weight = np.maximum(fit.gain[known], 0.0)  # a frame that hardly shows the body says little of its way
    mean = np.average(shifts[known], axis=0, weights=weight)
    axis = np.linalg.svd((shifts[known] - mean) * np.sqrt(weight)[:, None])[2][0]
    along = (shifts - mean) @ axis
    fitted = along
    for _ in range(_ROUNDS):
        fitted = _most_likely(sample, mean, axis, fitted)
    tried = (_unturned(mean, axis, places) for places in (along, fitted))
    return max((Slide(poses, score(sample, "slides", poses)) for poses in tried), key=lambda one: one.score.total)


def _unturned(mean: Floats, axis: Floats, along: Floats) -> list[Floats | None]:
    """Return poses at places (K,) along a line, px; ``None`` where they are unknown."""
    return [turned(np.zeros(2), 0.0, mean + one * axis) if np.isfinite(one) else None for one in along]


def _most_likely(sample: Sample, mean: Floats, axis: Floats, along: Floats) -> Floats:
    """Return the places (K,) along the line, px, at which the unturned body explains each frame best."""
    target = learn_target(sample, _unturned(mean, axis, along), np.arange(len(along)))
    body = body_of(target)
    if body is None:
        return along
    found = along.copy()
    for k in np.flatnonzero(np.isfinite(along)):
        tried = along[k] + _TRIED_PX
        poses = np.stack([turned(np.zeros(2), 0.0, mean + one * axis) for one in tried])
        frame = frame_of(target, sample.pictures[k], float(sample.excesses[k]))
        gains = body.gains(frame, poses).sum(axis=1)
        at = int(np.clip(np.argmax(gains), 1, len(tried) - 2))
        bend = float(gains[at - 1] + gains[at + 1] - 2.0 * gains[at])
        aside = 0.5 * float(gains[at - 1] - gains[at + 1]) / bend if bend < 0.0 else 0.0
        found[k] = tried[at] + np.clip(aside, -1.0, 1.0) * (tried[1] - tried[0])
    return found
