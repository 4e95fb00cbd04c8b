"""The loop: fit a model, test its residual, add the effect that explains it, validate it on held-out data, and repeat.

    base fit → stepwise selection (`anglecam.loop.stepwise`) → verdict

If the final model leaves significant structure that no candidate explains, the verdict is ``unexplained``. The search
works on stretches of long recordings; the errors and sizes that are stated are those of the whole recordings.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from anglecam.data.record import Record
from anglecam.effects import Effect
from anglecam.identification.fit import Fit
from anglecam.identification.initial_guess import start_parameters
from anglecam.identification.multiple_shooting import drifts, loses_step, windows
from anglecam.identification.noise import RESIDUAL, autoregression, noise_floor
from anglecam.identification.output_error import fit_output_error
from anglecam.loop.candidates import Candidate, promising
from anglecam.loop.cross_validation import compare, predict_held_out, split_records
from anglecam.loop.explained import shares_explained, why_stopped
from anglecam.loop.free_form.result import find_free_form
from anglecam.loop.policy import DEFAULT, Policy
from anglecam.loop.profile import interval_of
from anglecam.loop.refit import effects_left, effects_of, plant_of, refit_with_last, refit_with_phi, refit_without
from anglecam.loop.remaining_structure import gains_energy, structure_remains
from anglecam.loop.rivals import find_rivals
from anglecam.loop.screen import changes, directions, forecasts
from anglecam.loop.seat import seats_of
from anglecam.loop.standing import model_that_stands
from anglecam.loop.stepwise import (
    Assessment,
    Task,
    add_effects,
    add_more_effects,
    applicable,
    assess,
    rank_candidates,
)
from anglecam.loop.stretches import stretches
from anglecam.loop.verdict import Accepted, Verdict
from anglecam.loop.whole import with_whole_recordings
from anglecam.models.plant import FASTEST, Plant
from anglecam.progress import Progress, Stage, unseen
from anglecam.threads import map_in_threads

VERDICTS = {
    (False, False): "nothing_missing",
    (True, False): "attributed",
    (True, True): "partly_explained",
    (False, True): "unexplained",
}
"""Verdict by (whether effects are named, whether structure remains that they do not explain)."""
BLOCKS = 20
"""Blocks of cross-validation that fit into the longest recording at least: four for each of five folds."""


def close_records(
    records: Sequence[Record],
    *,
    held_out: Sequence[str] = (),
    starts: Sequence[np.ndarray] = (),
    seed: int = 0,
    progress: Progress = unseen,
    policy: Policy = DEFAULT,
) -> Verdict:
    """Close the loop on recordings of one rig.

    Parameters
    ----------
    records : sequence of Record
        At least one.
    held_out : sequence of str
        Names of recordings that are predicted only. The others are fitted, and predicted by cross-validation.
    starts : sequence of (3,) ndarray
        Further start values of a, b, c (1/s, 1/s², 1/s²) for the base fit.
    seed : int
        Of the bootstraps.
    progress : Progress
        Called with each stage.
    policy : Policy
        Every decision threshold.

    Returns
    -------
    Verdict
        With everything that the report shows.

    Raises
    ------
    RigError
        If every recording is held out.
    """
    # the matrices are small and several fits run at a time, so threads of linear algebra would only wait for each other
    with threadpool_limits(1, "blas"):
        fitted, predicted = split_records(records, held_out)
        task, base = begin(fitted, predicted, starts, np.random.default_rng(seed), progress, policy)
        progress(Stage("testing the residual"))
        first = assess(task, base)
        candidates: list[Candidate] = []
        if not first.residual_test.passed:
            progress(Stage("trying effects one by one"))
            candidates = rank_candidates(task, first)
        last = add_effects(task, first, first, candidates)
        final_task, last = _without_windows(task, first, last)
        progress(Stage("reaching the verdict"))
        verdict = _conclude(task, final_task, first, last, candidates)
        if max(map(_samples, (fitted, predicted))) <= policy.stepwise.most_samples:
            return _with_intervals(verdict)
        progress(Stage("fitting the whole recordings"))
        if final_task.uncut is not None:
            fitted, predicted = (windows(part, base.parameters) for part in (fitted, predicted))
        return _with_intervals(with_whole_recordings(verdict, fitted, predicted, task.rng))


def with_free_form(verdict: Verdict, *, seed: int = 0) -> Verdict:
    """Look for a torque of free form where the final model leaves structure.

    Parameters
    ----------
    verdict : Verdict
        From `close_records`.
    seed : int
        Of the bootstrap.

    Returns
    -------
    Verdict
        With ``free_form`` where a smooth function improves the prediction significantly.
    """
    if verdict.verdict in ("attributed", "nothing_missing"):
        return verdict
    fitted, held_out, fit, before = verdict.searched, verdict.searched_held_out, verdict.after, verdict.after_held_out
    rate = plant_of(fit).fastest / FASTEST
    left = effects_left(applicable([*fitted, *held_out], rate), fit)
    with threadpool_limits(1, "blas"):
        if fitted is not verdict.fitted:
            fit = fit_output_error(fit.model, fitted, [fit.parameters], phi=fit.phi)
            before, _ = predict_held_out(fit, fitted, held_out, verdict.policy)
        found = find_free_form(
            fit,
            before,
            fitted,
            held_out,
            left,
            [one for one in verdict.candidates if one.effect.id in [effect.id for effect in left]],
            np.random.default_rng(seed),
            verdict.policy,
        )
    return replace(verdict, free_form=found)


def begin(
    whole_fitted: Sequence[Record],
    whole_predicted: Sequence[Record],
    starts: Sequence[np.ndarray],
    rng: np.random.Generator,
    progress: Progress,
    policy: Policy,
) -> tuple[Task, Fit]:
    """Fit the base model to stretches of long recordings, in windows if a free run over them diverges.

    Parameters
    ----------
    whole_fitted, whole_predicted : sequence of Record
        The recordings that are fitted, and those that are only predicted.
    starts, rng, progress, policy
        As in `close_records`; ``rng`` is that of the bootstraps.

    Returns
    -------
    task : Task
        What the search works on.
    base : Fit
        Of the base model.
    """
    fitted, predicted = (stretches(part, policy.stepwise.most_samples) for part in (whole_fitted, whole_predicted))
    progress(Stage("fitting the base model"))
    found = start_parameters(fitted)
    plant = Plant(
        driven=any(r.command is not None for r in fitted), fastest=max(FASTEST, *(math.sqrt(s[1]) for s in found))
    )
    declared_starts = [s[: plant.base_count] for s in starts]
    base = fit_output_error(plant, fitted, [*found, *declared_starts])
    period = _natural_period(base.parameters, max(float(np.ptp(r.time)) for r in whole_fitted))
    policy = replace(policy, cross_validation=replace(policy.cross_validation, period_s=period))
    uncut = None
    if drifts(base.parameters, fitted) or loses_step(base, fitted):
        uncut = fitted, predicted
        fitted, predicted = (tuple(windows(part, base.parameters)) for part in uncut)
        base = fit_output_error(plant, fitted, [base.parameters, *declared_starts])
    ledger = tuple(applicable([*fitted, *predicted], plant.fastest / FASTEST))
    return Task(fitted, predicted, ledger, noise_floor(whole_fitted), rng, progress, policy, uncut), base


def _natural_period(parameters: np.ndarray, longest: float) -> float:
    """Return 2π over the magnitude of the slower pole, s, at most `BLOCKS` of them in the longest recording."""
    slower = float(np.min(np.abs(np.roots([1.0, parameters[0], parameters[1]]))))
    return min(2.0 * math.pi / max(slower, 1e-300), longest / BLOCKS)


def _samples(records: Sequence[Record]) -> int:
    return sum(len(record.time) for record in records)


def _without_windows(task: Task, first: Assessment, last: Assessment) -> tuple[Task, Assessment]:
    """Continue the search without windows if the effects found so far let a free run keep step."""
    if task.uncut is None or not effects_of(last.fit):
        return task, last
    fitted, predicted = task.uncut
    fit = fit_output_error(last.fit.model, fitted, [last.fit.parameters], phi=last.fit.phi)
    if drifts(fit.parameters, fitted) or loses_step(fit, fitted):
        return task, last
    task.progress(Stage("fitting without windows"))
    whole = replace(task, fitted=fitted, predicted=predicted, uncut=None)
    return whole, add_more_effects(whole, first, assess(whole, fit))


def _conclude(
    first_task: Task, task: Task, first: Assessment, last: Assessment, candidates: Sequence[Candidate]
) -> Verdict:
    """State the verdict; ``first_task`` is that of ``first``, in windows where the base model loses step."""
    # both models are compared with the AR(1) coefficient of the better model's residual
    before = refit_with_phi(first.fit, first_task.fitted, last.fit.phi)
    if task is not first_task:
        before = fit_output_error(first.fit.model, task.fitted, [first.fit.parameters], phi=last.fit.phi)
    before_held_out, _ = predict_held_out(before, task.fitted, task.predicted, task.policy)
    noise = task.noise_within(last.fit) or replace(autoregression(last.fit.residuals, RESIDUAL), sigma=last.fit.rmse)
    remains = structure_remains(task, first, last)
    # the base model may have been fitted in windows, which are not the recordings of this task
    final = model_that_stands(task, first, last, before_held_out) if remains else last
    final = first if gains_energy(final.fit, task.policy) else final
    named = effects_of(final.fit)
    # without an effect the final model is the base model
    after, after_held_out = (final.fit, final.held_out) if named or not remains else (before, before_held_out)
    left = final.cross_validated if named else before_held_out
    known_sigma = noise.sigma if noise.known else 0.0
    shares = shares_explained(task, final, before_held_out, known_sigma) if named else []
    where = seats_of(left.records, left.residuals, known_sigma, task.rng) if remains else ()
    return Verdict(
        VERDICTS[bool(named), remains],
        tuple(
            Accepted(effect, _rivals(after, effect, task), share) for effect, share in zip(named, shares, strict=True)
        ),
        before,
        after,
        before_held_out,
        after_held_out,
        compare(before_held_out, after_held_out, task.rng, task.policy),
        first.residual_test,
        last.residual_test,
        tuple(candidates),
        noise,
        task.fitted,
        task.predicted,
        task.fitted,
        task.predicted,
        task.policy,
        where,
        why_stopped(task, last, remains=remains),
    )


def _with_intervals(verdict: Verdict) -> Verdict:
    """State the 95 % interval of the size of each effect."""

    def interval(accepted: Accepted) -> tuple[float, float]:
        return interval_of(verdict.after, accepted.effect.parameters[0].name, verdict.fitted, verdict.noise)

    intervals = map_in_threads(interval, verdict.accepted)
    pairs = zip(verdict.accepted, intervals, strict=True)
    return replace(verdict, accepted=tuple(replace(one, interval_95=ends) for one, ends in pairs))


def _rivals(fit: Fit, effect: Effect, task: Task) -> dict[str, Fit]:
    """Return the effects that cannot be distinguished from one of the model's effects, the others kept in place.

    The promising ones are fitted, and every declared alias.
    """
    base, best = refit_without(fit, effect, task.fitted), refit_with_last(fit, effect, task.fitted)
    prediction_changes = changes(base, task.fitted, effects_left(task.ledger, base))
    ranked = forecasts(base, directions(base, task.fitted, prediction_changes, task.policy))
    tried = {f.effect.id for f in promising(ranked, task.policy)}.union(effect.aliases)
    others = [f for f in ranked if f.effect.id in tried and f.effect.id != effect.id]
    return find_rivals(best, base, task.fitted, effect, others, task.camera, task.policy)
