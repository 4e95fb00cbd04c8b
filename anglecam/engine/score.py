"""Explanations of what moves compete: each learns on half of the sample and predicts the pixels of the other half.

The currency is the log predictive density of held-out frames. Frames, not pixels, are the independent units: errors of
an appearance or of a codec are shared by the pixels of a frame. The difference of two explanations therefore has the
standard error of a mean over frames, and their ratio says how sure it is that one predicts better than the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from anglecam.data.typing import Floats
from anglecam.engine.likelihood import log_density
from anglecam.engine.sample import Sample
from anglecam.engine.target import learn_target, turned

NOTHING = "nothing moves"


@dataclass(frozen=True)
class Proposal:
    """Something that may move: a rigid body and its poses."""

    name: str
    centre_px: Floats
    """(2,) in the film, px."""
    turn: Floats
    """(K,) rotation in the frames of the sample, counter-clockwise as seen, rad; NaN where it is unknown."""

    def poses(self, sample: Sample) -> list[Floats | None]:
        """Return the (2, 3) maps from the coordinates of the body to the sample."""
        centre = sample.place(self.centre_px)
        return [turned(centre, t) if np.isfinite(t) else None for t in self.turn]


@dataclass(frozen=True)
class Score:
    """How well an explanation predicts."""

    name: str
    per_frame: Floats = field(repr=False)
    """(K,) log density of each frame, learnt from frames that it is not among, nats."""

    @property
    def total(self) -> float:
        """Sum over the frames, nats."""
        return float(self.per_frame.sum())

    def lead(self, other: Score) -> float:
        """Return by how much this explanation predicts a frame better than another one, in standard errors."""
        apart = self.per_frame - other.per_frame
        error = float(apart.std(ddof=1)) / np.sqrt(len(apart))
        return float(apart.mean()) / error if error > 0.0 else 0.0


def score(sample: Sample, name: str, poses: Sequence[Floats | None]) -> Score:
    """Return how well poses predict the sample, each half from the other.

    Parameters
    ----------
    sample : Sample
        K frames.
    name : str
        Of the explanation.
    poses : sequence of (2, 3) ndarray or None
        K maps from the coordinates of the body to the sample; all ``None``: nothing moves.
    """
    count = len(sample.pictures)
    per_frame = np.empty(count)
    known = list(poses)
    excess = [np.float32(sample.excess(picture)) for picture in sample.pictures]
    for half in range(2):
        target = learn_target(sample, known, np.arange(half, count, 2))
        for k in range(1 - half, count, 2):
            picture, variance = target.predict(known[k])
            density = log_density(sample.pictures[k], picture, variance + excess[k])
            per_frame[k] = float(density.sum(dtype=float))
    return Score(name, per_frame)
