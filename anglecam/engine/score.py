"""Explanations of what moves compete: each learns on half of the sample and predicts the pixels of the other half.

The currency is the log predictive density of held-out frames. Frames, not pixels, are the independent units: errors of
an appearance or of a codec are shared by the pixels of a frame. The difference of two explanations therefore has the
standard error of a mean over frames, and their ratio says how sure it is that one predicts better than the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

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
    """(2,) in the film, px; of a centre that is carried, in the coordinates of what carries it."""
    turn: Floats
    """(K,) rotation in the frames of the sample, counter-clockwise as seen, rad; NaN where it is unknown."""
    carrier: Floats | None = None
    """(K, 2, 3) poses, in the film, px, of what carries the centre; NaN where they are unknown. ``None``: the centre
    stands still."""

    def poses(self, sample: Sample) -> list[Floats | None]:
        """Return the (2, 3) maps from the coordinates of the body to the sample."""
        centre = sample.place(self.centre_px)
        shifts = carried_by(self.carriers(sample), centre)
        return [
            turned(centre, t, shift) if np.isfinite(t) and np.isfinite(shift).all() else None
            for t, shift in zip(self.turn, shifts, strict=True)
        ]

    def carriers(self, sample: Sample) -> Floats:
        """Return the (K, 2, 3) poses of what carries the centre, in the sample, px."""
        if self.carrier is None:
            return np.tile(np.eye(2, 3), (len(self.turn), 1, 1))
        rotation, offset = self.carrier[:, :, :2], self.carrier[:, :, 2]
        origin = rotation @ sample.in_film(np.zeros(2)) + offset
        return np.concatenate([rotation, sample.place(origin)[:, :, None]], axis=2)

    def in_film(self) -> Floats:
        """Return the (K, 2, 3) poses in the film, px; NaN where they are unknown."""
        still = np.tile(np.eye(2, 3), (len(self.turn), 1, 1))
        shifts = carried_by(still if self.carrier is None else self.carrier, self.centre_px)
        moved = (turned(self.centre_px, t, shift) for t, shift in zip(self.turn, shifts, strict=True))
        return np.stack(list(moved))

    def in_frames(self, frames: NDArray[np.int64], wanted: NDArray[np.int64]) -> Proposal:
        """Return a proposal for some frames of the film as one for other ones; NaN in those that it lacks."""
        at = {k: i for i, k in enumerate(frames.tolist())}
        known = np.array([at.get(k, -1) for k in wanted.tolist()])
        turn = np.where(known < 0, np.nan, self.turn[known])
        carrier = None
        if self.carrier is not None:
            carrier = np.where((known < 0)[:, None, None], np.nan, self.carrier[known])
        return replace(self, turn=turn, carrier=carrier)

    def every_other(self) -> Proposal:
        """Return a proposal for every other frame."""
        return replace(self, turn=self.turn[::2], carrier=None if self.carrier is None else self.carrier[::2])


def carried_by(carriers: Floats, centre: Floats) -> Floats:
    """Return (K, 2) by which poses (K, 2, 3) carry a centre (2,), px."""
    return np.asarray(carriers[:, :, :2] @ centre + carriers[:, :, 2] - centre)


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
    for half in range(2):
        target = learn_target(sample, known, np.arange(half, count, 2))
        for k in range(1 - half, count, 2):
            picture, variance = target.predict(known[k])
            density = log_density(sample.pictures[k], picture, variance + sample.excesses[k])
            per_frame[k] = float(density.sum(dtype=float))
    return Score(name, per_frame)
