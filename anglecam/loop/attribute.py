"""Attribution: every effect that could be added is fitted, and those that cannot be told apart are kept together."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm

from anglecam.effects import Effect
from anglecam.estimate.output_error import Fit, fit_output_error, predict_output_error
from anglecam.estimate.record import Record
from anglecam.simulate.plant import Plant


@dataclass(frozen=True)
class Candidate:
    """One effect added to a plant, fitted and tried on what was held out."""

    effect: Effect
    fit: Fit
    prediction: Fit
    """Of the held-out recordings."""
    log_likelihood_gain: float
    """Over the plant without it, on the fitted recordings."""
    held_out_gain: float
    """The same on the held-out recordings, which it was not fitted to."""

    @property
    def evidence(self) -> float:
        """Log-likelihood gain on fitted and held-out recordings, less one for each parameter spent."""
        return self.log_likelihood_gain + self.held_out_gain - len(self.effect.parameters)


def fit_candidates(
    base: Fit, fitted: Sequence[Record], held_out: Sequence[Record], effects: Sequence[Effect]
) -> list[Candidate]:
    """Fit each effect beside what the plant already has, and predict the held-out recordings with it.

    Parameters
    ----------
    base : Fit
        Of the plant so far, on ``fitted``.
    fitted, held_out : sequence of Record
        Recordings to fit and to predict.
    effects : sequence of Effect
        What to try.

    Returns
    -------
    list of Candidate
        Strongest evidence first.
    """
    before = predict_output_error(base, held_out)
    found = []
    for effect in effects:
        fit = fit_with(base, fitted, effect)
        prediction = predict_output_error(fit, held_out)
        found.append(Candidate(effect, fit, prediction, _gain(base, fit), _gain(before, prediction)))
    return sorted(found, key=lambda c: -c.evidence)


def fit_with(base: Fit, records: Sequence[Record], effect: Effect) -> Fit:
    """Fit the plant of ``base`` with one more effect, from every start that the effect proposes."""
    if not isinstance(base.model, Plant):
        raise TypeError("only a Plant takes effects")
    starts = []
    for i, parameter in enumerate(effect.parameters):
        for value in parameter.starts:
            own = effect.null
            own[i] = value
            starts.append(np.append(base.parameters, own))
    return fit_output_error(base.model.with_effect(effect), records, starts, own=base.own, phi=base.phi)


def alias_set(best: Candidate, base: Fit, records: Sequence[Record], others: Sequence[Candidate]) -> list[str]:
    """Keep every effect that could have made the data in which ``best`` explains this much more than it.

    If B were true, log L(A) − log L(B) would be normal with mean −d²/2 and variance d², d being the distance in
    standard deviations of the noise from B's prediction to the nearest that A can give (Cox, J. R. Statist. Soc. B
    24, 1962). B stays when the gap that was seen is not too large for that.

    Parameters
    ----------
    best : Candidate
        A.
    base : Fit
        The plant without either.
    records : sequence of Record
        The fitted recordings.
    others : sequence of Candidate
        Each a B.

    Returns
    -------
    list of str
        Ids, that of ``best`` first.
    """
    variance = best.fit.cost / max(1, len(best.fit.white) - best.fit.jacobian.shape[1])
    kept = [best.effect.id]
    for other in others:
        gap = best.log_likelihood_gain - other.log_likelihood_gain
        as_if = [
            replace(record, angle=record.angle - error)
            for record, error in zip(records, other.fit.residuals, strict=True)
        ]
        nearest = fit_with(replace(base, own=best.fit.own), as_if, best.effect)
        distance = math.sqrt(nearest.cost / variance)
        if distance == 0.0 or norm.sf((gap + 0.5 * distance**2) / distance) > 0.05:
            kept.append(other.effect.id)
    return kept


def _gain(before: Fit, after: Fit) -> float:
    if not math.isfinite(after.cost):
        return -math.inf
    finest = len(before.white) * 1e-9**2  # rad², so that data without any noise do not divide by nothing
    return 0.5 * len(before.white) * math.log((before.cost + finest) / (after.cost + finest))
