"""Attribution: fit every promising effect, and find the effects that the recordings cannot distinguish."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from types import MappingProxyType

import numpy as np
from scipy import special

from anglecam.data.record import Record
from anglecam.data.typing import Floats
from anglecam.effects import Effect
from anglecam.effects.seen import Motion, usual_range
from anglecam.identification.fit import Fit
from anglecam.identification.output_error import first_state, fit_best_start, fit_output_error, output_error
from anglecam.loop.cross_validation import Prediction, predict_held_out
from anglecam.loop.policy import DEFAULT, Policy
from anglecam.loop.refit import effects_of, fit_at, plant_of, refit_without
from anglecam.loop.screen import Forecast
from anglecam.threads import map_in_threads

STAGED_STARTS = 8
"""Start values of a staged parameter from which a fit is made: those with the smallest cost before fitting."""

FLAT_FACTORS = tuple(np.geomspace(0.5, 2.0, 13).tolist())
"""Multiples of a fitted staged parameter that are tried, 12 % apart."""
FLAT_ROUNDS = 4
"""Most fits from such multiples."""
LARGER = (2.0, 4.0, 8.0)
"""Multiples of a fitted size that are tried where it does not describe its effect."""


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


def fit_with(
    base: Fit,
    records: Sequence[Record],
    forecast: Forecast,
    *,
    staged: bool = True,
    camera: float = 0.0,
    policy: Policy = DEFAULT,
) -> Fit:
    """Fit the plant of ``base`` with one more effect.

    Parameters
    ----------
    base : Fit
        Of the plant so far, on ``records``.
    records : sequence of Record
        Recordings to fit.
    forecast : Forecast
        The effect, with its start values.
    staged : bool
        Whether to add the staged parameters that the data require; they take most of the time.
    camera : float
        Stated standard uncertainty of a film's angle, rad; 0 for angle series from elsewhere.
    policy : Policy
        Thresholds.

    Returns
    -------
    Fit
        The best of several starts: the forecast's, and where its gain falls short, others.
    """
    effect = forecast.effect
    unstaged = [p for p in effect.parameters if not p.staged]
    plant = plant_of(base).with_effect(replace(effect, parameters=tuple(unstaged)))
    nuisance = _nuisance_at_rest(base, records)

    def fit_from(*starts: Floats) -> Fit:
        values = [np.append(base.parameters, start[: len(unstaged)]) for start in starts]
        return fit_best_start(plant, records, values, nuisance, base.phi)

    near = [effect.null + share * (forecast.start - effect.null) for share in (0.5, 2.0)]
    # several parameters may give several local minima; dry friction does wherever the body sticks or breaks away
    several = len(unstaged) > 1 or effect.friction is not None
    incomplete, failed = policy.candidates.incomplete_fit_share, policy.candidates.failed_fit_share
    further = [(near, failed)] if several else [([forecast.tried, forecast.likeliest], incomplete), (near, failed)]
    best = fit_from(forecast.start, forecast.tried, forecast.likeliest) if several else fit_from(forecast.start)
    # the change by a limit is not proportional: scaled down, it may be zero and have no gradient
    for starts, share in further if forecast.share >= policy.screen.smallest_forecast_share else ():
        if log_likelihood_gain(base.cost, best.cost, len(base.white)) < share * forecast.gain:
            fit = fit_from(*starts)
            best = fit if fit.cost < best.cost else best
    if plant.kinked:
        # the initial states may have ended in a local minimum on the way
        again = fit_output_error(plant, records, [best.parameters], nuisance=nuisance, phi=base.phi)
        best = again if again.cost < best.cost else best
    return with_staged(base, effect, best, records, camera, policy) if staged else best


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


def _nuisance_at_rest(base: Fit, records: Sequence[Record]) -> list[Floats]:
    """Return the nuisance parameters of each recording, with zero rates if no command has moved the body yet.

    An effect that holds or delays the body has kinks. Dry friction, for instance, stops a small initial rate within a
    frame, so that the data hardly distinguish rate and angle there, and a fit that starts with the base model's rate
    keeps it.
    """
    first, states = [first_state(base.model, record) for record in records], base.model.states
    at_rest = [np.concatenate([fitted[:1], np.zeros(states - 1), fitted[states:]]) for fitted in base.nuisance]
    return [
        rest if state[1] == 0.0 else fitted for fitted, rest, state in zip(base.nuisance, at_rest, first, strict=True)
    ]


def fit_to_more(
    fit: Fit,
    records: Sequence[Record],
    nuisance: Sequence[Floats],
    ledger: Sequence[Effect],
    policy: Policy = DEFAULT,
) -> Fit:
    """Fit a plant to more recordings, with staged parameters of its effects that the first ones did not require."""
    best = fit_output_error(fit.model, records, [fit.parameters], nuisance=nuisance, phi=fit.phi)
    for effect in effects_of(fit):
        whole = next(e for e in ledger if e.id == effect.id)
        if any(p.staged for p in whole.parameters):
            unstaged = tuple(p for p in whole.parameters if not p.staged)
            base = refit_without(best, effect, records)
            size = [best.parameters[best.model.names.index(p.name)] for p in unstaged]
            plant = plant_of(base).with_effect(replace(whole, parameters=unstaged))
            start = np.append(base.parameters, size)
            first = fit_output_error(plant, records, [start], nuisance=best.nuisance, phi=fit.phi)
            best = min(best, with_staged(base, whole, first, records, policy=policy), key=lambda one: one.cost)
    return best


def with_staged(
    base: Fit,
    effect: Effect,
    fit: Fit,
    records: Sequence[Record],
    camera: float = 0.0,
    policy: Policy = DEFAULT,
) -> Fit:
    """Add the staged parameters of a fit's last effect, one after another, as far as the data require them.

    Added all at once, they could take over the role of the effect's first parameter. A single one may gain nothing
    although it and the next one together do. The instant at which a stuck body breaks away is all or nothing, so the
    cost has many local minima: of many starts, each with the previous staged parameters as fitted and without them,
    those with the smallest cost are fitted. In a film, staged parameters must also change the prediction by more than
    the angle's uncertainty, because a smaller change may follow errors of the measurement.
    """
    plant, best, spent = plant_of(base), fit, 0
    effect = _bound_speeds(effect, fit, records, policy)
    first = len(base.parameters) + sum(not p.staged for p in effect.parameters)
    for count in range(len(effects_of(fit)[-1].parameters) + 1, len(effect.parameters) + 1):
        richer = plant.with_effect(replace(effect, parameters=effect.parameters[:count]))
        bare = np.append(fit.parameters[:first], np.zeros(len(fit.parameters) - first))
        before = [fit.parameters] if np.array_equal(bare, fit.parameters) else [fit.parameters, bare]
        values = [np.append(x, v) for v in effect.parameters[count - 1].starts for x in before]
        values.sort(key=lambda one: output_error(richer, one, records, fit.nuisance, fit.phi))
        fit = fit_best_start(richer, records, values[:STAGED_STARTS], fit.nuisance, fit.phi)
        fit, spent = _beyond_flat(fit, records, policy), spent + 1
        gain = log_likelihood_gain(best.cost, fit.cost, len(fit.white))
        needed = special.chdtri(spent, policy.candidates.false_staged_parameter_rate)
        if 2.0 * gain > needed and rms_difference(fit, best) > camera:
            best, spent = fit, 0
    return best


def _beyond_flat(fit: Fit, records: Sequence[Record], policy: Policy) -> Fit:
    """Fit again from other values of the last parameter while they lower the cost; the cost is flat between events."""
    for _ in range(FLAT_ROUNDS):
        value = fit.parameters[-1]
        values = [np.append(fit.parameters[:-1], factor * value) for factor in FLAT_FACTORS]
        costs = [output_error(fit.model, one, records, fit.nuisance, fit.phi) for one in values]
        if log_likelihood_gain(fit.cost, min(costs), len(fit.white)) < policy.stepwise.better_minimum_nat:
            break
        start = values[int(np.argmin(costs))]
        fit = fit_output_error(fit.model, records, [start], nuisance=fit.nuisance, phi=fit.phi)
    return fit


def _bound_speeds(effect: Effect, fit: Fit, records: Sequence[Record], policy: Policy) -> Effect:
    """Bound parameters that are speeds to slow motion: a curve over all speeds can take the shape of other effects."""
    predicted = [(r.time, r.angle - left) for r, left in zip(records, fit.residuals, strict=True)]
    fastest = max(float(np.max(np.abs(np.gradient(angle, time)))) for time, angle in predicted)
    slow = policy.candidates.slow_speed_share * fastest
    bounded = [replace(p, upper=min(p.upper, slow)) if p.is_speed else p for p in effect.parameters]
    return replace(effect, parameters=tuple(bounded))


def find_rivals(
    best: Fit,
    base: Fit,
    records: Sequence[Record],
    effect: Effect,
    others: Sequence[Forecast],
    camera: float = 0.0,
    policy: Policy = DEFAULT,
) -> dict[str, Fit]:
    """Find every effect B that could have produced the data although ``effect``, A, explains them better.

    If B is true, log L(A) − log L(B) is normal with mean −d²/2 and variance d², where d is the distance, in standard
    deviations of the noise, from B's prediction to the nearest prediction of A (Cox, J. R. Statist. Soc. B 24, 1962).
    Whatever d is, the difference exceeds z²/2 no more often than a standard normal variable exceeds z. A is the best of
    several effects, and each of them can exceed it, so the rate is divided among them (Bonferroni). Each parameter that
    A has more than B follows noise, and counts one nat (Akaike). Where B's best fit does not describe B, the nearest
    one that does is judged. In a film, errors of the measurement may follow the motion, too, so a difference below the
    angle's uncertainty does not count.

    Parameters
    ----------
    best : Fit
        With ``effect``.
    base : Fit
        The same plant without it.
    records : sequence of Record
        The fitted recordings.
    effect : Effect
        A.
    others : sequence of Forecast
        Each a B.
    camera : float
        Stated standard uncertainty of a film's angle, rad; 0 for angle series from elsewhere.
    policy : Policy
        Thresholds.

    Returns
    -------
    dict
        Id of each B that cannot be excluded → the same plant with B in place of ``effect``.
    """

    def fit_rival(other: Forecast) -> Fit | None:
        return _nearest_possible(fit_with(base, records, other, camera=camera, policy=policy), records)

    others = [other for other in others if other.effect.id != effect.id]
    fits = [(other, fit) for other, fit in zip(others, map_in_threads(fit_rival, others), strict=True) if fit]
    widest = 0.5 * special.ndtri(policy.candidates.true_rival_rejection_rate / max(1, len(others))) ** 2

    def gap(fit: Fit) -> float:
        more = max(0, len(best.parameters) - len(fit.parameters))
        return log_likelihood_gain(fit.cost, best.cost, len(best.white)) - more

    return {other.effect.id: fit for other, fit in fits if gap(fit) <= widest or rms_difference(fit, best) <= camera}


def _nearest_possible(fit: Fit, records: Sequence[Record]) -> Fit | None:
    """Return a fit, or else one with a larger size of its last effect that describes that effect; see `is_possible`.

    A stop that is hardly touched is fitted as well by a spring that is softer than any stop.
    """
    name = effects_of(fit)[-1].parameters[0].name
    size = float(fit.parameters[fit.model.names.index(name)])
    tried = chain([fit], (fit_at(fit, name, times * size, records) for times in LARGER))
    return next((one for one in tried if is_possible(one, records)), None)


def is_possible(fit: Fit, records: Sequence[Record]) -> bool:
    """Return whether the parameters of a plant's last effect describe that effect at all; see `Effect.possible`."""
    plant, effect = plant_of(fit), effects_of(fit)[-1]
    first = len(fit.parameters) - len(effect.parameters)
    abc = np.zeros(3)
    abc[: plant.base_count] = fit.parameters[: plant.base_count]
    predicted = np.concatenate([r.angle - left for r, left in zip(records, fit.residuals, strict=True)])
    span = max(float(r.time[-1] - r.time[0]) for r in records)
    motion = Motion(float(predicted.min()), float(predicted.max()), usual_range(predicted), span)
    return effect.possible(tuple(effect.complete(fit.parameters[first:]).tolist()), tuple(abc.tolist()), motion)


def rms_difference(one: Fit, other: Fit) -> float:
    """Return the RMS difference, rad, between the predictions of two fits to the same recordings."""
    return float(np.sqrt(np.mean((np.concatenate(one.residuals) - np.concatenate(other.residuals)) ** 2)))


def log_likelihood_gain(before: float, after: float, n: int) -> float:
    """Return the log-likelihood gain of n whitened residuals whose sum of squares, rad², falls from before to after."""
    if not math.isfinite(after):
        return -math.inf
    offset = n * 1e-9**2  # rad²; avoids a division by zero for data without noise
    return 0.5 * n * math.log((before + offset) / (after + offset))
