"""Explanations of what moves compete: each learns on half of the sample and predicts the pixels of the other half.

The currency is the log predictive density of held-out frames. Of two explanations, one gains in each frame something
over the other, and it would gain a certain amount if the frame were exactly as it predicts. The share of what it would
gain, over all frames, says how right it is; frames in which both predict the same say nothing, however many they are.
Only pixels count that the body covers in any frame: of two things that turn, each is right where it is.
Frames, not pixels, are the independent units: errors of an appearance or of a codec are shared by the pixels of a
frame. The share has the standard error of a ratio of sums over frames (Cochran, Sampling Techniques, 1977), which says
how sure it is that the one predicts better than the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Flags, Floats
from anglecam.engine.likelihood import log_density
from anglecam.engine.sample import Sample
from anglecam.engine.target import turned
from anglecam.engine.target_learning import learn_target

NOTHING = "nothing moves"
_MOST_VARIANCE = 256.0**2 / 2.0
"""Grey levels²; no more has a pixel."""


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
    density: NDArray[np.float16] = field(repr=False)
    """(K, h, w) log density of each pixel, learnt from frames that its own is not among, nats."""
    pictures: NDArray[np.float16] = field(repr=False)
    """(K, h, w) what it predicts, grey levels; NaN where nothing is known of a frame."""
    variances: NDArray[np.float16] = field(repr=False)
    """(K, h, w) grey levels²."""
    covers: Flags = field(repr=False)
    """(K, h, w) pixels that the body covers in each frame."""

    @cached_property
    def total(self) -> float:
        """Sum over pixels and frames, nats."""
        return float(self.density.sum(dtype=float))

    @cached_property
    def covered(self) -> Flags:
        """(h, w) pixels that the body covers in any frame; all where there is none."""
        covered = np.asarray(self.covers.any(axis=0))
        return covered if covered.any() else np.ones_like(covered)

    def _of(self, other: Score, where: Flags) -> Floats:
        """Return the log density (K,) of what another explanation predicts, of some pixels (K, h, w)."""
        sums = np.empty(len(where))
        for k, counts in enumerate(where):
            picture, mean, variance = (
                one[k][counts].astype(np.float32)[None] for one in (other.pictures, self.pictures, self.variances)
            )
            sums[k] = float(log_density(picture, mean, variance).sum(dtype=float))
        return sums

    def over(self, other: Score) -> Lead:
        """Return by how much this explanation predicts better than another one of the same frames.

        What the other one's body covers and this one's does not is left to the other one: a hand may be there as well.
        A frame in which neither shows its body says nothing: what they predict there is the background of either.
        """
        shown = (self.covers | other.covers).any(axis=(1, 2), keepdims=True)
        where = self.covered & (self.covers | ~other.covers) & shown
        gained = (self.density - other.density).sum(axis=(1, 2), where=where, dtype=float)
        expected = np.maximum(self._of(self, where) - other._of(self, where), 0.0)
        whole = float(expected.sum())
        share = float(gained.sum()) / whole if whole > 0.0 else 0.0
        count = len(gained)
        error = float(np.sqrt(((gained - share * expected) ** 2).sum() * count / (count - 1)))
        return Lead(share, float(gained.sum()) / error if error > 0.0 else 0.0)

    def lead(self, other: Score) -> float:
        """Return by how much this explanation predicts better than another one, in standard errors."""
        return self.over(other).errors


@dataclass(frozen=True)
class Lead:
    """By how much one explanation predicts better than another one."""

    share: float
    """Of what it would gain if it were right."""
    errors: float
    """The same in its standard errors."""


def score(sample: Sample, name: str, poses: Sequence[Floats | None], *, lit: bool = False) -> Score:
    """Return how well poses predict the sample, each half from the other.

    Parameters
    ----------
    sample : Sample
        K frames.
    name : str
        Of the explanation.
    poses : sequence of (2, 3) ndarray or None
        K maps from the coordinates of the body to the sample; all ``None``: nothing moves.
    lit : bool
        Whether the brightness of the body changes with its turn before the light.
    """
    count = len(sample.pictures)
    shape = sample.pictures.shape
    density, pictures, variances = (np.empty(shape, np.float16) for _ in range(3))
    covers = np.zeros(shape, bool)
    known = list(poses)
    for half in range(2):
        target = learn_target(sample, known, np.arange(half, count, 2), lit=lit)
        for k in range(1 - half, count, 2):
            pose = known[k]
            picture, variance = target.predict(pose)
            variance = variance + sample.excesses[k]
            density[k] = log_density(sample.pictures[k], picture, variance)
            pictures[k] = np.where(np.isfinite(sample.pictures[k]), picture, np.nan)
            variances[k] = np.minimum(variance, _MOST_VARIANCE)
            if pose is not None:
                covers[k] = target.covers(pose)
    return Score(name, density, pictures, variances, covers)
