"""Fit one more effect to a plant: from several starts, and with the staged parameters that the data require."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy import special

from anglecam.data.record import Record
from anglecam.data.typing import Floats
from anglecam.effects import Effect
from anglecam.identification.fit import Fit
from anglecam.identification.output_error import first_state, fit_best_start, fit_output_error, output_error
from anglecam.loop.likelihood import log_likelihood_gain, rms_difference
from anglecam.loop.policy import DEFAULT, Policy
from anglecam.loop.refit import effects_of, plant_of, refit_without
from anglecam.loop.screen import Forecast

STAGED_STARTS = 8
"""Start values of a staged parameter from which a fit is made: those with the smallest cost before fitting."""
FLAT_FACTORS = tuple(np.geomspace(0.5, 2.0, 13).tolist())
"""Multiples of a fitted staged parameter that are tried, 12 % apart."""
LIMIT_ROUNDS = 4
"""Most fits with the largest size that can exist."""
FLAT_ROUNDS = 4
"""Most fits from such multiples."""


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
    best = _within_physics(best, records)
    return with_staged(base, effect, best, records, camera, policy) if staged else best


def _within_physics(fit: Fit, records: Sequence[Record]) -> Fit:
    """Fit again with the largest size of the last effect that can exist, if the fitted one exceeds it.

    The largest size depends on the other parameters, which change with it.
    """
    *others, effect = effects_of(fit)
    if effect.largest is None:
        return fit
    for _ in range(LIMIT_ROUNDS):
        plant = plant_of(fit)
        values = effect.complete(fit.parameters[-len(effect.parameters) :])
        abc = (*fit.parameters[: plant.base_count].tolist(), 0.0)[:3]
        most = effect.largest(tuple(values.tolist()), abc)
        if values[0] <= most:
            break
        limited = replace(plant, effects=(*others, effect.limited(most)))
        fit = fit_output_error(limited, records, [fit.parameters], nuisance=fit.nuisance, phi=fit.phi)
    return fit


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
