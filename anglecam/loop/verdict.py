"""What closing the loop returns."""

from __future__ import annotations

from dataclasses import dataclass

from anglecam.data.record import Record
from anglecam.effects import Effect
from anglecam.identification.fit import Fit
from anglecam.identification.noise import Noise
from anglecam.loop.candidates import Candidate
from anglecam.loop.cross_validation import Gain, Prediction
from anglecam.loop.residual_test import ResidualTest


@dataclass(frozen=True)
class Accepted:
    """An effect that was added."""

    effect: Effect
    rivals: dict[str, Fit]
    """What it cannot be told from: the model with each of these in its place, on the fitted recordings."""

    @property
    def alias_set(self) -> tuple[str, ...]:
        """Ids, its own first."""
        return (self.effect.id, *self.rivals)


@dataclass(frozen=True)
class Verdict:
    """What the loop found."""

    verdict: str
    """``attributed``, ``nothing_missing`` or ``unexplained``."""
    accepted: tuple[Accepted, ...]
    before: Fit
    """The base model on the fitted recordings."""
    after: Fit
    """The final model on the same."""
    before_held_out: Prediction
    after_held_out: Prediction
    gain: Gain
    first_test: ResidualTest
    last_test: ResidualTest
    candidates: tuple[Candidate, ...]
    """Those of the first round, strongest evidence first; none where the gate found nothing missing."""
    noise: Noise
    fitted: tuple[Record, ...]
    held_out: tuple[Record, ...]
    """By declaration; may be none."""
