"""What a body that turns may be mistaken for: one that moves along a straight line and does not turn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anglecam.data.typing import Floats
from anglecam.engine.body import Body, Frame, body_of, frame_of, highest, poses_about
from anglecam.engine.refine import Fit
from anglecam.engine.sample import Sample
from anglecam.engine.score import Score, score
from anglecam.engine.target import turned
from anglecam.engine.target_learning import learn_target

_ROUNDS = 3
"""Of learning and locating in turn: a turning body, whose turns it begins at, has had as many."""
_STEP_PX = 0.5
_TRIED_PX = _STEP_PX * np.arange(-6.0, 7.0)
"""Shifts along the line, and across it, by which a place may be off."""


@dataclass(frozen=True)
class Slide:
    """A body that moves along a straight line and does not turn."""

    poses: list[Floats | None]
    """K maps (2, 3) from the coordinates of the body to the sample, px; ``None`` where it is not seen."""
    score: Score


def slide_of(sample: Sample, fit: Fit) -> Slide:
    """Return a body that moves on a straight line near the way of a turning one's middle.

    The line, and the places on it, are those at which the unturned body is most likely: the one explanation must not be
    worse than the other only because the other was fitted.
    """
    poses = fit.proposal.poses(sample)
    rows, columns = np.nonzero(fit.target.visibility)
    middle = np.array([columns.mean(), rows.mean()]) - fit.target.pad
    shifts = np.array([np.full(2, np.nan) if p is None else p[:, :2] @ middle + p[:, 2] - middle for p in poses])
    known = np.isfinite(shifts[:, 0])
    weight = np.maximum(fit.gain[known], 0.0)  # a frame that hardly shows the body says little of its way
    mean = np.average(shifts[known], axis=0, weights=weight)
    axis = np.linalg.svd((shifts[known] - mean) * np.sqrt(weight)[:, None])[2][0]
    shifts = mean + ((shifts - mean) @ axis)[:, None] * axis
    for _ in range(_ROUNDS):
        shifts = _most_likely(sample, shifts, axis)
    poses = _unturned(shifts)
    return Slide(poses, score(sample, "slides", poses))


def _unturned(shifts: Floats) -> list[Floats | None]:
    """Return the poses of a body that is shifted by (K, 2) px; ``None`` where it is unknown by how much."""
    return [turned(np.zeros(2), 0.0, one) if np.isfinite(one).all() else None for one in shifts]


def _most_likely(sample: Sample, shifts: Floats, axis: Floats) -> Floats:
    """Return the shifts (K, 2), px, of most likelihood on a straight line near given ones along an axis (2,)."""
    target = learn_target(sample, _unturned(shifts), np.arange(len(shifts)))
    body = body_of(target)
    if body is None:
        return shifts
    across = np.array([-axis[1], axis[0]])
    found, aside, weight = shifts.copy(), np.full(len(shifts), np.nan), np.zeros(len(shifts))
    for k in np.flatnonzero(np.isfinite(shifts[:, 0])):
        frame = frame_of(target, sample.pictures[k], float(sample.excesses[k]))
        found[k] += _best(frame, body, found[k], axis)[0] * axis
        aside[k], weight[k] = _best(frame, body, found[k], across)
    # the line is that of all frames, and no frame may leave it
    known = weight > 0.0
    if known.sum() < 2:
        return found
    along = (found - shifts[known].mean(axis=0)) @ axis
    line = np.polynomial.Polynomial.fit(along[known], aside[known], 1, w=np.sqrt(weight[known]))
    return found + line(along)[:, None] * across


def _best(frame: Frame, body: Body, shift: Floats, axis: Floats) -> tuple[float, float]:
    """Return by how much further along an axis a body is most likely, px, and the weight of that, 1/px²."""
    poses = poses_about(np.zeros(2), np.zeros(len(_TRIED_PX)), shift + _TRIED_PX[:, None] * axis)
    at, along, curvature = highest(body.gains(frame, poses).sum(axis=1))
    return float(_TRIED_PX[at]) + along * _STEP_PX, max(-curvature, 0.0) / _STEP_PX**2
