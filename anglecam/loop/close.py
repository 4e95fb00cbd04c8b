"""The loop: fit, test the residual, name the effect, add it, prove it on what was not fitted, and again.

    base fit → rounds of `anglecam.loop.stepwise` → verdict

What remains after the last round, and would still be seen, is ``unexplained``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from anglecam.data.record import Record
from anglecam.effects import Effect
from anglecam.identification.fit import Fit
from anglecam.identification.initial_guess import start_parameters
from anglecam.identification.multiple_shooting import drifts, loses_step, windows
from anglecam.identification.noise import autoregression, noise_floor
from anglecam.identification.output_error import fit_output_error, predict_output_error
from anglecam.loop.candidates import Candidate, find_rivals, fit_to_more, log_likelihood_gain, promising
from anglecam.loop.cross_validation import Prediction, compare, predict_held_out, robust_sigma, split_records
from anglecam.loop.refit import effects_left, effects_of, refit_with_last, refit_with_phi, refit_without
from anglecam.loop.residual_test import LEVEL
from anglecam.loop.screen import changes, directions, forecasts
from anglecam.loop.stepwise import (
    SURE,
    Assessment,
    Task,
    add_effects,
    applicable,
    assess,
    rank_candidates,
    smallest_traced,
)
from anglecam.loop.verdict import Accepted, Verdict
from anglecam.models.plant import Plant

CONTRADICTED = 3.0
"""A model that errs this many times more on what was held out than on what was fitted lacks something there, or one of
its parameters was not told by what was fitted."""
REMAINDER, REMAINDER_UNDRIVEN = 0.1, 0.75
"""After an effect has proven itself, what remains must also be this share of what the base model left, or it does not
take the verdict back. Where nothing is commanded, or nothing tells the noise, most of it may be what no model of a
mechanism holds, such as the hand that let go."""


def close_records(
    records: Sequence[Record],
    *,
    held_out: Sequence[str] = (),
    starts: Sequence[np.ndarray] = (),
    seed: int = 0,
    progress: Callable[[str], None] = lambda stage: None,
) -> Verdict:
    """Close the loop on recordings of one rig.

    Parameters
    ----------
    records : sequence of Record
        At least one.
    held_out : sequence of str
        Names that are predicted only; the others are also predicted, block by block, by fits to the rest.
    starts : sequence of (3,) ndarray
        Further a, b, c (1/s, 1/s², 1/s²) to start the base fit from.
    seed : int
        Of the bootstraps.
    progress : callable
        Told the name of each stage as it begins.

    Returns
    -------
    Verdict
        With everything that the report shows.
    """
    # small matrices, and several fits at a time: threads of linear algebra would only wait for each other
    with threadpool_limits(1, "blas"):
        task, base = _begin(records, held_out, starts, np.random.default_rng(seed), progress)
        progress("residual")
        first = assess(task, base)
        candidates: list[Candidate] = []
        if not first.residual_test.passed:
            progress("candidates")
            candidates = rank_candidates(task, first)
        last = add_effects(task, first, candidates)
        progress("verdict")
        return _conclude(task, first, last, candidates)


def _begin(
    records: Sequence[Record],
    held_out: Sequence[str],
    starts: Sequence[np.ndarray],
    rng: np.random.Generator,
    progress: Callable[[str], None],
) -> tuple[Task, Fit]:
    """Fit the base model, in windows where a free run would go astray."""
    fitted, predicted = split_records(records, held_out)
    plant = Plant(driven=any(r.command is not None for r in fitted))
    progress("base model")
    own_starts = [s[: plant.base_count] for s in starts]
    base = fit_output_error(plant, fitted, [*start_parameters(fitted), *own_starts])
    floor = noise_floor(fitted)
    if drifts(base.parameters, fitted) or loses_step(base, fitted):
        fitted, predicted = windows(fitted, base.parameters), windows(predicted, base.parameters)
        base = fit_output_error(plant, fitted, [base.parameters, *own_starts])
    ledger = applicable([*fitted, *predicted])
    return Task(tuple(fitted), tuple(predicted), tuple(ledger), floor, rng, progress), base


def _conclude(task: Task, first: Assessment, last: Assessment, candidates: Sequence[Candidate]) -> Verdict:
    # both ends are compared under the colour of the noise that the better model leaves
    before = refit_with_phi(first.fit, task.fitted, last.fit.phi)
    before_told, _ = predict_held_out(before, task.fitted, task.predicted)
    noise = task.floor or replace(autoregression(last.fit.residuals, "residual"), sigma=last.fit.rmse)
    remains = _remains(task, first, last, before)
    # where something remains nothing is named, so nothing is added
    after, after_told = (before, before_told) if remains else (last.fit, last.held_out)
    named = effects_of(after)
    return Verdict(
        "unexplained" if remains else "attributed" if named else "nothing_missing",
        tuple(Accepted(effect, _rivals(after, effect, task)) for effect in named),
        before,
        after,
        before_told,
        after_told,
        compare(before_told, after_told, task.rng),
        first.residual_test,
        last.residual_test,
        tuple(candidates),
        noise,
        task.fitted,
        task.predicted,
    )


def _remains(task: Task, first: Assessment, last: Assessment, before: Fit) -> bool:
    """Say whether the best model leaves structure that no candidate explains."""
    named, least = bool(effects_of(last.fit)), smallest_traced(task, first)
    if _contradicted(task, last, least):
        return True
    if last.residual_test.p_value >= (SURE if named else LEVEL) or last.fit.rmse**2 <= task.camera**2 + least**2:
        return False
    driven = any(r.command is not None for r in task.fitted)
    share = REMAINDER if driven and task.floor is not None else REMAINDER_UNDRIVEN
    # told by the noise floor, whatever it is, and by what would explain most of it, which is finer; where nothing but
    # what is left over would tell the noise, all of that counts
    floor = task.floor.sigma if task.floor else 0.0
    return (
        not named
        or _beyond(last.cross_validated, floor) > share * _beyond(first.cross_validated, floor)
        or _could_still_gain(last, before) > share**2
    )


def _contradicted(task: Task, last: Assessment, least: float) -> bool:
    """Say whether what was held out is as no parameters of the model would have it that fit the rest too.

    Typically: whether dry friction lets go at an instant is all or nothing, and one wrong guess is no contradiction.
    """
    most = CONTRADICTED * max(last.fit.rmse, least)
    if last.held_out.robust_sigma <= most or not task.predicted:
        return last.held_out.robust_sigma > most
    told = predict_output_error(last.fit, task.predicted)
    own, both = [*last.fit.nuisance, *told.nuisance], [*task.fitted, *task.predicted]
    fit = fit_to_more(last.fit, both, own, task.ledger)
    return robust_sigma(fit.residuals[len(task.fitted) :]) > most


def _beyond(prediction: Prediction, noise: float) -> float:
    """Return what a prediction errs by beyond the noise, rad."""
    return math.sqrt(max(prediction.rmse**2 - noise**2, 0.0))


def _could_still_gain(now: Assessment, before: Fit) -> float:
    """Return what one more effect, or a torque of any curve, is forecast to explain.

    As a share of that and all that was explained since before. What only follows the measured angle about, such as a
    codec that is late where the head moves, is no cause.
    """
    more = max(now.residual_test.torque_gain, *(forecast.gain for forecast in now.forecasts[:1]), 0.0)
    if more <= 0.0:
        return 0.0
    return more / (more + max(log_likelihood_gain(before.cost, now.fit.cost, len(before.white)), 0.0))


def _rivals(fit: Fit, effect: Effect, task: Task) -> dict[str, Fit]:
    """Say of an effect, the others in place, what it cannot be told from."""
    base, best = refit_without(fit, effect, task.fitted), refit_with_last(fit, effect, task.fitted)
    moved = changes(base, task.fitted, effects_left(task.ledger, base))
    others = [f for f in promising(forecasts(base, directions(base, task.fitted, moved))) if f.effect.id != effect.id]
    return find_rivals(best, base, task.fitted, effect, others, task.camera)
