"""What closing the loop returns."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from anglecam.data.record import Record
from anglecam.data.rounding import with_uncertainty
from anglecam.data.tables import html_table, pandas_table
from anglecam.effects import Effect
from anglecam.identification.fit import Fit
from anglecam.identification.noise import Noise
from anglecam.identification.systematic import full_sigma
from anglecam.loop.candidates import Candidate
from anglecam.loop.cross_validation import Gain, Prediction
from anglecam.loop.free_form.result import FreeForm
from anglecam.loop.policy import DEFAULT, Policy
from anglecam.loop.residual_test import ResidualTest
from anglecam.loop.seat import Seat

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Accepted:
    """An effect that was added."""

    effect: Effect
    rivals: dict[str, Fit]
    """Effects that the recordings cannot distinguish from it: id → the model with that effect in its place, on the
    fitted recordings."""
    explains: float = math.nan
    """Share of the base model's error beyond the noise, in squares, that it takes away beside the effects
    before it."""
    interval_95: tuple[float, float] = (-math.inf, math.inf)
    """95 % interval of the effect's size, its first parameter, SI; infinite where the recordings set no limit."""

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
    where: tuple[Seat, ...] = ()
    """Where what the final model leaves is larger than elsewhere; empty if no structure remains."""
    stopped_by: str = ""
    """Why no further effect is named, as a sentence."""
    free_form: FreeForm | None = None
    """A torque that the final model lacks; ``None`` if no structure remains or no such torque improves the
    prediction."""

    @cached_property
    def parameters(self) -> dict[str, dict[str, float]]:
        """Parameters of the final model by name: ``value`` and ``sigma``, in the unit that the name states."""
        fit = self.after
        added = [p for a in self.accepted for p in a.effect.parameters]
        base = len(fit.parameters) - len(added)
        sigma = full_sigma(fit, self.fitted, self.noise)
        pairs = list(zip(fit.parameters.tolist(), sigma.tolist(), strict=True))
        # a larger uncertainty than the range between the bounds means that the recordings do not determine the
        # parameter, for instance the asymmetry of a friction that hardly acts
        effect_pairs = [
            (value, s if s < p.upper - p.lower else np.nan) for p, (value, s) in zip(added, pairs[base:], strict=True)
        ]
        stated = pairs[:base] + [p.in_file_unit(*pair) for p, pair in zip(added, effect_pairs, strict=True)]
        return {name: {"value": value, "sigma": s} for name, (value, s) in zip(fit.model.names, stated, strict=True)}

    def to_pandas(self) -> pd.DataFrame:
        """Return the final model as a table by ``parameter``.

        Returns
        -------
        pandas.DataFrame
            ``effect`` (empty for the base model), ``value``, ``sigma`` and the ``null`` at which the effect is absent,
            each in the unit that the parameter's name ends in.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        of = {p.name: (a.effect.id, p.in_file_unit(p.null)[0]) for a in self.accepted for p in a.effect.parameters}
        columns = {
            "parameter": list(self.parameters),
            "effect": [of.get(name, ("", np.nan))[0] for name in self.parameters],
            "value": [p["value"] for p in self.parameters.values()],
            "sigma": [p["sigma"] for p in self.parameters.values()],
            "null": [of.get(name, ("", np.nan))[1] for name in self.parameters],
        }
        return pandas_table(columns, "parameter")

    def _repr_html_(self) -> str:
        """Return verdict, effects and errors for notebooks."""
        rows = []
        for accepted in self.accepted:
            sizes = (
                f"{p.name} = {with_uncertainty(self.parameters[p.name]['value'], self.parameters[p.name]['sigma'])}"
                for p in accepted.effect.parameters
            )
            rows.append([accepted.effect.id, ", ".join(sizes)])
            if accepted.rivals:
                rows.append(["cannot be distinguished from", ", ".join(accepted.rivals)])
        before, after = (np.degrees(p.rmse) for p in (self.before_held_out, self.after_held_out))
        low, high = self.gain.interval_95
        rows += [
            ["prediction error, ° RMS", f"{before:.4g} before, {after:.4g} after"],
            ["reduction of the error", f"{self.gain.ratio:.3g}, 95 % interval {low:.3g} … {high:.3g}"],
            ["p-value of the base model's residual", f"{self.first_test.p_value:.3g}"],
        ]
        return html_table(self.verdict.replace("_", " "), ["", ""], rows)
