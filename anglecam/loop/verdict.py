"""What closing the loop returns."""

from __future__ import annotations

from dataclasses import dataclass

from anglecam.data.record import Record
from anglecam.effects import Effect
from anglecam.identification.fit import Fit
from anglecam.identification.noise import Noise
from anglecam.loop.candidates import Candidate
from anglecam.loop.cross_validation import Gain, Prediction
from anglecam.loop.free_form.result import FreeForm
from anglecam.loop.policy import DEFAULT, Policy
from anglecam.loop.residual_test import ResidualTest


@dataclass(frozen=True)
class Accepted:
    """An effect that was added."""

    effect: Effect
    rivals: dict[str, Fit]
    """Effects that the recordings cannot distinguish from it: id → the model with that effect in its place, on the
    fitted recordings."""

    @property
    def alias_set(self) -> tuple[str, ...]:
        """Ids of the effect and of its rivals, the effect first."""
        return (self.effect.id, *self.rivals)


@dataclass(frozen=True)
class Verdict:
    """The result of the loop, with everything that supports it."""

    verdict: str
    """``attributed``, ``nothing_missing``, ``partly_explained`` or ``unexplained``."""
    accepted: tuple[Accepted, ...]
    """Effects that were added, in the order in which they were added."""
    before: Fit
    """The base model on the fitted recordings."""
    after: Fit
    """The final model on the fitted recordings."""
    before_held_out: Prediction
    """Of the held-out recordings by the base model, or of all frames by cross-validation if none is held out."""
    after_held_out: Prediction
    """The same by the final model."""
    gain: Gain
    first_test: ResidualTest
    """Of the base model's residual."""
    last_test: ResidualTest
    """Of the residual of the last model that was tried."""
    candidates: tuple[Candidate, ...]
    """For the base model, strongest evidence first; empty if the residual test shows no structure."""
    noise: Noise
    """Of the angle."""
    fitted: tuple[Record, ...]
    """The recordings; windows of them where a free run diverges."""
    held_out: tuple[Record, ...]
    """Recordings that were predicted only; may be empty."""
    searched: tuple[Record, ...]
    """What the search was made on: ``fitted``, or stretches of long recordings. The tests, the candidates and the
    rivals are those of the search."""
    searched_held_out: tuple[Record, ...]
    """The same of ``held_out``."""
    policy: Policy = DEFAULT
    """The thresholds that led to the verdict."""
    free_form: FreeForm | None = None
    """A torque that the final model lacks; ``None`` if no structure remains or no such torque improves the
    prediction."""
