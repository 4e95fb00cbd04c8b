"""Searches the quantities for a smooth torque that explains what a model leaves, and fits it with the plant.

every quantity and pair → linear regression, cross-validated → the best ones by output error, cross-validated → one
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations, pairwise

import numpy as np

from anglecam.data.record import Record
from anglecam.data.typing import Floats
from anglecam.identification.fit import Fit
from anglecam.identification.output_error import fit_output_error, predict_output_error
from anglecam.loop.cross_validation import NEVER_LEFT_OUT, Gain, Prediction, compare, fold_numbers, predict_held_out
from anglecam.loop.free_form.basis import curve_over
from anglecam.loop.free_form.penalised import predicted_left, smoothing, solved
from anglecam.loop.free_form.visited import Visited
from anglecam.loop.policy import DEFAULT, Policy
from anglecam.loop.refit import plant_of
from anglecam.models.curved_plant import Curve, CurvedPlant, curved

FITTED = 2
"""Curves over one quantity that are fitted by output error, best by linear regression first."""
ROUNDS = 2
"""Most fits by output error of one curve, each with the smoothness that the last one calls for."""
RATIOS = tuple(10.0**decade for decade in range(-3, 4))
"""Ratios of the smoothness along two axes that are tried."""
SAME_SMOOTHNESS = 2.0
"""Factor of each λ within which a fit is not repeated."""


@dataclass(frozen=True)
class Screened:
    """A curve that was fitted by linear regression."""

    curve: Curve
    start: Floats
    """(m,) parameters, rad/s²."""
    predicted: Prediction = field(repr=False)
    """Cross-validated, whitened."""


@dataclass(frozen=True)
class Curved:
    """A curve that was fitted with the plant by output error."""

    fit: Fit
    cross_validated: Prediction = field(repr=False)
    """Of the fitted recordings; it chooses among curves, so that the held-out recordings remain unseen."""

    @property
    def curve(self) -> Curve:
        """The curve."""
        return curve_of(self.fit)


@dataclass(frozen=True)
class Found:
    """The curve that predicts best."""

    fit: Fit
    after: Prediction = field(repr=False)
    """Of the held-out recordings, or of all frames by cross-validation if none is held out."""
    gain: Gain
    """Of the prediction, over the model without the curve."""


def curve_of(fit: Fit) -> Curve:
    """Return the curve of a fitted `CurvedPlant`, or raise `TypeError`."""
    if not isinstance(fit.model, CurvedPlant):
        raise TypeError("only a CurvedPlant has a curve")
    return fit.model.curve


def screen(visited: Visited, policy: Policy = DEFAULT) -> list[Screened]:
    """Fit a curve over every quantity and pair by linear regression of the residual, best prediction first."""
    fit, names = visited.fit, visited.names
    known, left = fit.slopes.projected, fit.slopes.without_followed(fit.white)
    own = fit.slopes.without_own(fit.white)
    folds = np.concatenate([fold_numbers(record, fit.phi, policy) for record in visited.records])
    found = []
    for over in [*((name,) for name in names), *combinations(names, 2)]:
        curve = curve_over(visited, over)
        response = fit.slopes.without_own(visited.responses(curve))
        free = fit.slopes.without_followed(response)
        curve = replace(curve, smoothness=smoothing(free, left, _roughness(curve), len(left) - fit.slopes.rank))
        roughness = curve.penalty.T @ curve.penalty
        start = solved(free.T @ free + roughness, free.T @ left)
        error = predicted_left(known, response, own, roughness, folds)
        found.append(Screened(curve, start, _prediction(visited.records, error, folds)))
    return sorted(found, key=lambda one: one.predicted.cost)


def _prediction(records: Sequence[Record], error: Floats, folds: Floats) -> Prediction:
    """Return the errors of the frames that were left out."""
    edges = np.cumsum([0, *(len(r.time) for r in records)])
    kept = [folds[i:j] != NEVER_LEFT_OUT for i, j in pairwise(edges)]
    parts = [error[i:j][k] for (i, j), k in zip(pairwise(edges), kept, strict=True)]
    tested = tuple(record.only(k) for record, k in zip(records, kept, strict=True))
    return Prediction(tested, tuple(parts), float(sum(e @ e for e in parts)))


def fit_curve(base: Fit, records: Sequence[Record], one: Screened) -> Fit:
    """Fit a plant with a curve by output error; the smoothness is estimated again at the solution."""
    curve, start, nuisance = one.curve, np.append(base.parameters, one.start), base.nuisance
    fit = base
    for _ in range(ROUNDS):
        model = curved(plant_of(base), curve)
        fit = fit_output_error(model, records, [start], nuisance=nuisance, phi=base.phi)
        start, nuisance = fit.parameters, fit.nuisance
        smoothness = _smoothness_at(fit)
        if np.allclose(np.log(smoothness), np.log(curve.smoothness), rtol=0.0, atol=np.log(SAME_SMOOTHNESS)):
            break
        curve = replace(curve, smoothness=smoothness)
    return fit


def _smoothness_at(fit: Fit) -> tuple[float, ...]:
    """Return the best λ of each axis at a fit."""
    curve, slopes = curve_of(fit), fit.slopes
    first = len(fit.parameters) - curve.count
    known, _ = np.linalg.qr(slopes.projected[:, :first])
    response = slopes.projected[:, first:]
    response = response - known @ (known.T @ response)
    left = slopes.without_own(fit.white)
    left = left - known @ (known.T @ left) + response @ fit.parameters[first:]
    return smoothing(response, left, _roughness(curve), len(left) - slopes.rank + curve.count, RATIOS)


def _roughness(curve: Curve) -> list[Floats]:
    return [rows.T @ rows for rows in curve.bending]


def search(
    visited: Visited,
    before: Prediction,
    predicted: Sequence[Record],
    rng: np.random.Generator,
    policy: Policy = DEFAULT,
) -> Found | None:
    """Return the best curve, or ``None`` if none improves the prediction significantly.

    Parameters
    ----------
    visited : Visited
        Of the model that leaves structure, in the recordings that it was fitted to.
    before : Prediction
        Of the held-out recordings by that model, or of all frames by cross-validation if none is held out.
    predicted : sequence of Record
        The held-out recordings; may be empty.
    rng : numpy.random.Generator
        For bootstrap intervals.
    policy : Policy
        Thresholds.

    Returns
    -------
    Found or None
        A curve over two quantities only if it predicts significantly better than any over one; over time only if a
        recording is held out.
    """
    base, fitted = visited.fit, visited.records
    # through the blocks of one recording a function of time leads without any knowledge of the cause
    screened = [one for one in screen(visited, policy) if predicted or "time" not in one.curve.over]
    single = [one for one in screened if len(one.curve.axes) == 1]
    pairs = [one for one in screened if len(one.curve.axes) == 2]
    tried = [_curved(base, one, fitted, policy) for one in single[:FITTED]]
    best = min(tried, key=lambda one: one.cross_validated.cost)
    if pairs and compare(single[0].predicted, pairs[0].predicted, rng, policy).lower_bound > 0.0:
        both = _curved(base, pairs[0], fitted, policy)
        if compare(best.cross_validated, both.cross_validated, rng, policy).lower_bound > 0.0:
            best = both
    after = best.cross_validated
    if predicted:
        unseen = predict_output_error(best.fit, predicted)
        after = Prediction(tuple(predicted), unseen.residuals, unseen.cost)
    gain = compare(before, after, rng, policy)
    return Found(best.fit, after, gain) if gain.lower_bound > 0.0 else None


def _curved(base: Fit, one: Screened, fitted: Sequence[Record], policy: Policy) -> Curved:
    fit = fit_curve(base, fitted, one)
    return Curved(fit, predict_held_out(fit, fitted, (), policy)[0])
