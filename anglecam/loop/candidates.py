"""Attribution: every effect that could be added is fitted, and those that cannot be told apart are kept together."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import special

from anglecam.data.record import Record
from anglecam.effects import Effect
from anglecam.identification.fit import Fit
from anglecam.identification.output_error import first_state, fit_best_start, fit_output_error, output_error
from anglecam.loop.cross_validation import Prediction, predict_held_out
from anglecam.loop.refit import effects_of, plant_of, refit_without
from anglecam.loop.screen import Forecast
from anglecam.threads import native_threads

T = TypeVar("T")
R = TypeVar("R")

PROMISING, LEAST_PROMISING = 8, 3
"""Most and fewest effects that are fitted, of those that the screen puts first."""
HOPEFUL = 0.2
"""Share of the best forecast below which an effect is not fitted, or if so from one start only, and of the best fit
below which it is not tried on what was not fitted."""
FULFILLED = 0.7
"""Share of its forecast that a fit must reach, or else it begins again from where the screen tried the effect and from
the effect's own start; and if it then reaches less than `HOPEFUL`, from half and twice the forecast's."""
ASKED_FOR = 0.01
"""Late parameters of an effect are left out unless without them so good a fit of them would be this improbable."""
NEAREST = 8
"""Starts of a late parameter that are fitted from, of those that come nearest."""
SLOW = 0.2
"""Share of the fastest speed in the recordings that counts as slow."""
ALIAS_LEVEL = 0.05


@dataclass(frozen=True)
class Candidate:
    """One effect added to a plant and fitted, and, where it is a serious one, tried on what it was not fitted to."""

    forecast: Forecast
    fit: Fit
    log_likelihood_gain: float
    """Over the plant without it, on the fitted recordings."""
    held_out: Prediction | None
    """Of what is held out by declaration, or of all block by block where nothing is."""
    cross_validated: Prediction | None
    """Of every frame by a model that was not fitted to it."""
    predictive_gain: float
    """Log-likelihood gain on ``unseen``."""

    @property
    def effect(self) -> Effect:
        """What was added, with those of its parameters that the data asked for."""
        return effects_of(self.fit)[-1]

    @property
    def evidence(self) -> float:
        """Log-likelihood gained on what was fitted and on what was not, less one for each parameter spent."""
        return self.log_likelihood_gain + self.predictive_gain - len(self.effect.parameters)


def promising(all_forecasts: Sequence[Forecast]) -> list[Forecast]:
    """Choose the effects that are worth a fit from forecasts in falling order."""
    return [f for i, f in enumerate(all_forecasts[:PROMISING]) if i < LEAST_PROMISING or f.share >= HOPEFUL]


def fit_candidates(
    base: Fit,
    cross_validated: Prediction,
    fitted: Sequence[Record],
    held_out: Sequence[Record],
    tried: Sequence[Forecast],
    camera: float = 0.0,
) -> list[Candidate]:
    """Fit effects beside what the plant already has, and predict what they were not fitted to.

    Parameters
    ----------
    base : Fit
        Of the plant so far, on ``fitted``.
    cross_validated : Prediction
        The plant's so far, of every frame by a fit without it.
    fitted, held_out : sequence of Record
        Recordings to fit and to predict only.
    tried : sequence of Forecast
        What to try, and from where.
    camera : float
        Stated uncertainty of a film's angle, rad; 0 for a series from elsewhere.

    Returns
    -------
    list of Candidate
        Strongest evidence first, then those that were not tried, best fit first.
    """
    fits = map_in_threads(lambda one: fit_with(base, fitted, one, camera=camera), tried)
    gains = [log_likelihood_gain(base.cost, fit.cost, len(base.white)) for fit in fits]
    serious = sorted(gains, reverse=True)[: LEAST_PROMISING - 1]

    def predict(i: int) -> Candidate:
        if gains[i] < HOPEFUL * max(gains) and gains[i] not in serious:
            return Candidate(tried[i], fits[i], gains[i], None, None, -math.inf)
        told, whole = predict_held_out(fits[i], fitted, held_out)
        predictive = log_likelihood_gain(cross_validated.cost, whole.cost, sum(len(r.time) for r in whole.records))
        return Candidate(tried[i], fits[i], gains[i], told, whole, predictive)

    candidates = map_in_threads(predict, range(len(tried)))
    return sorted(candidates, key=lambda c: (-c.evidence, -c.log_likelihood_gain))


def fit_with(
    base: Fit, records: Sequence[Record], forecast: Forecast, *, staged: bool = True, camera: float = 0.0
) -> Fit:
    """Fit the plant of ``base`` with one more effect, from where the screen would start, or else the effect itself.

    Its ``late`` parameters, which take most of the time, are let in as far as the data ask for them, or not at all.
    """
    effect = forecast.effect
    early = [p for p in effect.parameters if not p.staged]
    plant = plant_of(base).with_effect(replace(effect, parameters=tuple(early)))
    own = _held(base, records)

    def fit_from(*starts: NDArray[np.float64]) -> Fit:
        values = [np.append(base.parameters, start[: len(early)]) for start in starts]
        return fit_best_start(plant, records, values, own, base.phi)

    first = effect.null
    first[0] = effect.parameters[0].starts[0]
    near = [effect.null + share * (forecast.start - effect.null) for share in (0.5, 2.0)]
    # several parameters may have several valleys, and dry friction has them whenever a head is held or sets off
    several = len(early) > 1 or effect.friction is not None
    further = [(near, HOPEFUL)] if several else [([forecast.tried, first], FULFILLED), (near, HOPEFUL)]
    best = fit_from(forecast.start, forecast.tried, first) if several else fit_from(forecast.start)
    # what a limit does is not in proportion: scaled down it may do nothing, where nothing tells which way to go
    for starts, share in further if forecast.share >= HOPEFUL else ():
        if log_likelihood_gain(base.cost, best.cost, len(base.white)) < share * forecast.gain:
            fit = fit_from(*starts)
            best = fit if fit.cost < best.cost else best
    if plant.kinked:
        # on the way here initial states may have got into a valley of their own
        again = fit_output_error(plant, records, [best.parameters], nuisance=own, phi=base.phi)
        best = again if again.cost < best.cost else best
    return with_staged(base, effect, best, records, camera) if staged else best


def fit_from_candidates(base: Fit, candidates: Sequence[Candidate], records: Sequence[Record]) -> Fit:
    """Fit a plant again from where it stands in the candidates, if one of them is better there even without its effect.

    Beside another effect, whatever its size, a fit with kinks may have come out of the valley that it was in.
    """
    count = len(base.parameters)
    starts = [(c.fit.parameters[:count], c.fit.nuisance) for c in candidates]
    costs = [output_error(base.model, values, records, own, base.phi) for values, own in starts]
    if not costs or min(costs) >= base.cost:
        return base
    values, own = starts[int(np.argmin(costs))]
    return fit_output_error(base.model, records, [values], nuisance=own, phi=base.phi)


def _held(base: Fit, records: Sequence[Record]) -> list[NDArray[np.float64]]:
    """Return each recording's own unknowns at rest where no command has moved the head yet.

    What holds a head or makes it answer late has kinks: dry friction, say, stops a small initial rate within a frame,
    so that rate and angle there can hardly be told apart, and a fit that starts with the base model's rate keeps it.
    """
    first, states = [first_state(base.model, record) for record in records], base.model.states
    at_rest = [np.concatenate([own[:1], np.zeros(states - 1), own[states:]]) for own in base.nuisance]
    return [rest if one[1] == 0.0 else own for own, rest, one in zip(base.nuisance, at_rest, first, strict=True)]


def fit_to_more(
    fit: Fit, records: Sequence[Record], own: Sequence[NDArray[np.float64]], ledger: Sequence[Effect]
) -> Fit:
    """Fit a plant again to more recordings, with late parameters of its effects that the first ones did not ask for."""
    best = fit_output_error(fit.model, records, [fit.parameters], nuisance=own, phi=fit.phi)
    for effect in effects_of(fit):
        whole = next(e for e in ledger if e.id == effect.id)
        if any(p.staged for p in whole.parameters):
            early = tuple(p for p in whole.parameters if not p.staged)
            base = refit_without(best, effect, records)
            size = [best.parameters[best.model.names.index(p.name)] for p in early]
            plant = plant_of(base).with_effect(replace(whole, parameters=early))
            start = np.append(base.parameters, size)
            first = fit_output_error(plant, records, [start], nuisance=best.nuisance, phi=fit.phi)
            best = min(best, with_staged(base, whole, first, records), key=lambda one: one.cost)
    return best


def with_staged(base: Fit, effect: Effect, fit: Fit, records: Sequence[Record], camera: float = 0.0) -> Fit:
    """Let in the late parameters of a fit's last effect, one after another, as far as the data ask for them.

    At once, they would stand in for the size; one alone may show nothing that it and the next do show. When a head sets
    off is all or nothing, so there are valleys everywhere: of many starts, each with the late parameters before it as
    they are and without them, the fit begins from those that come nearest. In a film they must also change the
    prediction by more than the angle is uncertain: what is finer may follow the measurement's own errors.
    """
    plant, best, spent = plant_of(base), fit, 0
    effect = _within(effect, fit, records)
    first = len(base.parameters) + sum(not p.staged for p in effect.parameters)
    for count in range(len(effects_of(fit)[-1].parameters) + 1, len(effect.parameters) + 1):
        richer = plant.with_effect(replace(effect, parameters=effect.parameters[:count]))
        bare = np.append(fit.parameters[:first], np.zeros(len(fit.parameters) - first))
        values = [np.append(x, v) for v in effect.parameters[count - 1].starts for x in (fit.parameters, bare)]
        values.sort(key=lambda one: output_error(richer, one, records, fit.nuisance, fit.phi))
        fit, spent = fit_best_start(richer, records, values[:NEAREST], fit.nuisance, fit.phi), spent + 1
        gain = log_likelihood_gain(best.cost, fit.cost, len(fit.white))
        if 2.0 * gain > special.chdtri(spent, ASKED_FOR) and rms_difference(fit, best) > camera:
            best, spent = fit, 0
    return best


def _within(effect: Effect, fit: Fit, records: Sequence[Record]) -> Effect:
    """Bound an effect's speeds to the slow part of what the recordings show: a curve over all of it is any curve."""
    predicted = [(r.time, r.angle - left) for r, left in zip(records, fit.residuals, strict=True)]
    fastest = max(float(np.max(np.abs(np.gradient(angle, time)))) for time, angle in predicted)
    slow = [replace(p, upper=min(p.upper, SLOW * fastest)) if p.is_speed else p for p in effect.parameters]
    return replace(effect, parameters=tuple(slow))


def find_rivals(
    best: Fit, base: Fit, records: Sequence[Record], effect: Effect, others: Sequence[Forecast], camera: float = 0.0
) -> dict[str, Fit]:
    """Keep every effect that could have made the data in which ``effect`` explains this much more than it.

    If B were true, log L(A) − log L(B) would be normal with mean −d²/2 and variance d², d being the distance in
    standard deviations of the noise from B's prediction to the nearest that A can give (Cox, J. R. Statist. Soc. B
    24, 1962). Whatever d is, the gap is then larger than z²/2 no more often than a normal variable is larger than z.
    In a film there are errors that follow the motion too: what is finer than the angle's uncertainty decides nothing.

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
        Stated uncertainty of a film's angle, rad; 0 for a series from elsewhere.

    Returns
    -------
    dict
        Id of each that stays → the same plant with it in place of ``effect``.
    """
    fits = map_in_threads(lambda other: fit_with(base, records, other, camera=camera), others)
    widest = 0.5 * special.ndtri(ALIAS_LEVEL) ** 2
    gaps = [log_likelihood_gain(fit.cost, best.cost, len(best.white)) for fit in fits]
    return {
        other.effect.id: fit
        for other, fit, gap in zip(others, fits, gaps, strict=True)
        if (gap <= widest or rms_difference(fit, best) <= camera) and other.effect.id != effect.id
    }


def rms_difference(one: Fit, other: Fit) -> float:
    """Return by how much the predictions of two fits to the same recordings differ, rad RMS."""
    return float(np.sqrt(np.mean((np.concatenate(one.residuals) - np.concatenate(other.residuals)) ** 2)))


def map_in_threads(work: Callable[[T], R], items: Sequence[T]) -> list[R]:
    """Do the same with every item side by side: the integrator, which takes most of the time, lets go of Python."""
    with ThreadPoolExecutor(native_threads()) as pool:
        return list(pool.map(work, items))


def log_likelihood_gain(before: float, after: float, n: int) -> float:
    """Return what the log-likelihood of n whitened residuals gains where their sum of squares, rad², falls."""
    if not math.isfinite(after):
        return -math.inf
    finest = n * 1e-9**2  # rad², so that data without any noise do not divide by nothing
    return 0.5 * n * math.log((before + finest) / (after + finest))
