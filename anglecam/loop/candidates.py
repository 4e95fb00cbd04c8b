"""Attribution: fit every promising effect in addition to those of the model, and predict with each."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from anglecam.data.record import Record
from anglecam.effects import Effect
from anglecam.identification.fit import Fit
from anglecam.identification.output_error import fit_output_error, output_error
from anglecam.loop.cross_validation import Prediction, predict_held_out
from anglecam.loop.fit_effect import fit_with
from anglecam.loop.likelihood import log_likelihood_gain
from anglecam.loop.policy import DEFAULT, Policy
from anglecam.loop.refit import effects_of
from anglecam.loop.rivals import is_possible
from anglecam.loop.screen import Forecast
from anglecam.threads import map_in_threads


@dataclass(frozen=True)
class Candidate:
    """One effect added to a plant and fitted, and cross-validated unless its fit is poor."""

    forecast: Forecast
    fit: Fit
    log_likelihood_gain: float
    """Over the plant without the effect, on the fitted recordings, nat."""
    held_out: Prediction | None
    """Prediction of the held-out recordings, or of all frames by cross-validation if no recording is held out."""
    cross_validated: Prediction | None
    """Prediction of every frame by a model that was not fitted to it."""
    predictive_gain: float
    """Log-likelihood gain on ``cross_validated``, nat; −∞ where it is ``None``."""
    competing: float = 1.0
    """Number of independent directions of which the effect's best one was found in the residual."""

    @property
    def effect(self) -> Effect:
        """The added effect, with the staged parameters that the data require."""
        return effects_of(self.fit)[-1]

    @property
    def penalty(self) -> float:
        """Gain that noise alone is expected to give, nat: one for each parameter, and the search among directions.

        Akaike, IEEE Trans. Autom. Control 19, 1974; the best of m independent directions gains ln m more.
        """
        return len(self.effect.parameters) + math.log(self.competing)

    @property
    def evidence(self) -> float:
        """Log-likelihood gain on the fitted recordings less `penalty`, nat. Candidates are chosen by it."""
        return self.log_likelihood_gain - self.penalty


def promising(all_forecasts: Sequence[Forecast], policy: Policy = DEFAULT) -> list[Forecast]:
    """Choose the effects to fit from forecasts in descending order."""
    screen = policy.screen
    return [
        f
        for i, f in enumerate(all_forecasts[: screen.most_fitted])
        if i < screen.fewest_fitted or f.share >= screen.smallest_forecast_share
    ]


def fit_candidates(
    base: Fit,
    cross_validated: Prediction,
    fitted: Sequence[Record],
    held_out: Sequence[Record],
    tried: Sequence[Forecast],
    camera: float = 0.0,
    policy: Policy = DEFAULT,
    competing: Mapping[str, float] = MappingProxyType({}),
) -> list[Candidate]:
    """Fit each effect in addition to those of the plant, and predict what it was not fitted to.

    Parameters
    ----------
    base : Fit
        Of the plant so far, on ``fitted``.
    cross_validated : Prediction
        Of every frame by the plant so far, fitted without that frame.
    fitted, held_out : sequence of Record
        Recordings to fit and to predict only.
    tried : sequence of Forecast
        The effects, with their start values.
    camera : float
        Stated standard uncertainty of a film's angle, rad; 0 for angle series from elsewhere.
    policy : Policy
        Thresholds.
    competing : mapping
        Effect id → number of independent directions among which its best one was found; 1 for others.

    Returns
    -------
    list of Candidate
        Strongest evidence first, then those that were not cross-validated, best fit first; without effects whose
        fitted parameters are not possible.
    """
    fits = map_in_threads(lambda one: fit_with(base, fitted, one, camera=camera, policy=policy), tried)
    possible = [(one, fit) for one, fit in zip(tried, fits, strict=True) if is_possible(fit, fitted)]
    tried, fits = [one for one, _ in possible], [fit for _, fit in possible]
    gains = [log_likelihood_gain(base.cost, fit.cost, len(base.white)) for fit in fits]
    best_gains = sorted(gains, reverse=True)[: policy.screen.fewest_fitted - 1]
    smallest, among = policy.candidates.smallest_gain_share, [competing.get(one.effect.id, 1.0) for one in tried]

    def predict(i: int) -> Candidate:
        if gains[i] < smallest * max(gains) and gains[i] not in best_gains:
            return Candidate(tried[i], fits[i], gains[i], None, None, -math.inf, among[i])
        declared, all_frames = predict_held_out(fits[i], fitted, held_out, policy)
        count = sum(len(r.time) for r in all_frames.records)
        predictive = log_likelihood_gain(cross_validated.cost, all_frames.cost, count)
        return Candidate(tried[i], fits[i], gains[i], declared, all_frames, predictive, among[i])

    candidates = map_in_threads(predict, range(len(tried)))
    return sorted(candidates, key=lambda c: (c.cross_validated is None, -c.evidence))


def fit_from_candidates(base: Fit, candidates: Sequence[Candidate], records: Sequence[Record]) -> Fit:
    """Fit a plant again from its parameters in a candidate, if they lower its cost even without the added effect.

    While another effect was fitted, a plant with kinks may have left the local minimum in which it was.
    """
    count = len(base.parameters)
    starts = [(c.fit.parameters[:count], c.fit.nuisance) for c in candidates]
    costs = [output_error(base.model, values, records, nuisance, base.phi) for values, nuisance in starts]
    if not costs or min(costs) >= base.cost:
        return base
    values, nuisance = starts[int(np.argmin(costs))]
    return fit_output_error(base.model, records, [values], nuisance=nuisance, phi=base.phi)
