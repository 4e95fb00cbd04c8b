"""Stepwise selection: test a model's residual, fit candidates, cross-validate them, add the best one, and repeat.

    residual → residual test → candidates → cross-validation → accept → residual → …

Each round makes one test, at its part of the false-alarm rate (`Policy.level`): the residual must show structure, and
noise alone must seldom give any effect a gain as improbable as that of the best candidate. Besides, the candidate must
predict better than chance allows: the lower end of the bootstrap interval of the gain must be above zero. What is
predicted was used neither to fit the candidate nor to choose it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from anglecam.data.record import Record
from anglecam.effects import LEDGER, Effect
from anglecam.identification.fit import Fit
from anglecam.identification.noise import QUANTISED, RESIDUAL, Noise, autoregression, correlated_share
from anglecam.loop.candidates import Candidate, fit_candidates, fit_from_candidates, promising
from anglecam.loop.cross_validation import Prediction, chosen_without, predict_held_out, predicts_better
from anglecam.loop.fit_effect import fit_with
from anglecam.loop.likelihood import log_likelihood_gain, rms_difference
from anglecam.loop.policy import DEFAULT, Policy
from anglecam.loop.refit import effects_left, effects_of, refit_with_phi, refit_without
from anglecam.loop.residual_test import ResidualTest, run_residual_test
from anglecam.loop.rivals import is_possible
from anglecam.loop.screen import Change, Forecast, changes, directions, forecasts
from anglecam.loop.size import sizes_determined
from anglecam.progress import Progress, Stage
from anglecam.threads import map_in_threads

NARROW, WIDE = math.radians(20.0), math.radians(120.0)
"""Ranges of motion, rad, between which bounds and starts of the effects hold as they stand."""
STILL = 1e-6
"""Smallest range of motion, rad, to which they are scaled: that of a body at rest is zero."""


@dataclass(frozen=True)
class Task:
    """What the loop works on."""

    fitted: tuple[Record, ...]
    predicted: tuple[Record, ...]
    """Held-out recordings; may be empty."""
    ledger: tuple[Effect, ...]
    """Effects that these recordings can show."""
    floor: Noise | None
    """Noise of the angle, apart from any model."""
    rng: np.random.Generator
    progress: Progress
    policy: Policy = DEFAULT
    uncut: tuple[tuple[Record, ...], tuple[Record, ...]] | None = None
    """Fitted and held-out recordings before they were cut into windows; ``None`` if they are whole."""

    @property
    def camera(self) -> float:
        """Size of errors that may follow the motion, rad.

        In a film that is the stated standard uncertainty, for a quantised angle a share of the rounding error's; for
        other angle series it is 0.
        """
        if self.floor is None:
            return 0.0
        if self.floor.source == QUANTISED:
            return self.policy.stepwise.rounding_error_share * self.floor.sigma
        return self.floor.sigma if self.floor.filmed else 0.0

    def noise_within(self, fit: Fit) -> Noise | None:
        """Return the noise, or ``None`` if it is unknown or contradicted by the much smaller residual of a fit.

        A film's stated uncertainty includes errors that are common to all frames, so it may exceed any residual.
        """
        most = self.policy.verdict.noise_contradiction_ratio * fit.rmse
        return self.floor if self.floor and (self.floor.filmed or self.floor.sigma <= most) else None


@dataclass(frozen=True)
class Assessment:
    """A fitted model, its predictions and the test of its residual."""

    fit: Fit
    held_out: Prediction
    """Prediction of the held-out recordings, or of all frames by cross-validation if no recording is held out."""
    cross_validated: Prediction
    """Prediction of every frame by a model that was not fitted to it."""
    residual_test: ResidualTest
    forecasts: tuple[Forecast, ...]
    """Effects to fit next, largest forecast first."""


def assess(task: Task, fit: Fit) -> Assessment:
    """Estimate the noise's AR(1) coefficient, fit the plant again with it, predict and test the residual."""
    policy = task.policy
    prediction_changes = changes(fit, task.fitted, effects_left(task.ledger, fit))
    phi, estimated = _noise_phi(task, fit, prediction_changes)
    fit = refit_with_phi(fit, task.fitted, phi)
    effect_directions = directions(fit, task.fitted, prediction_changes, policy)
    held_out, cross_validated = predict_held_out(fit, task.fitted, task.predicted, policy)
    smallest_rms = max(policy.stepwise.numerical_error_rad, policy.stepwise.film_error_sigmas * task.camera)
    tested = run_residual_test(
        fit, task.fitted, effect_directions, task.rng, smallest_rms, policy, phi_estimated=estimated
    )
    chosen = promising(forecasts(fit, effect_directions), policy)
    return Assessment(fit, held_out, cross_validated, tested, tuple(chosen))


def smallest_structure(task: Task, first: Assessment) -> float:
    """Return the RMS, rad, below which structure is not searched."""
    limits = task.policy.stepwise
    return max(
        limits.numerical_error_rad,
        limits.film_error_sigmas * task.camera,
        limits.model_error_share * first.cross_validated.rmse,
    )


def smallest_first_effect(task: Task, first: Assessment, best: Fit) -> float:
    """Return the RMS change, rad, that a first effect must make to be accepted.

    In a film this is at least the stated uncertainty of the angle, and at least twice the part of it that does not
    scatter from frame to frame once the effect is in the model, because only that part can follow the motion as an
    effect does. (Both factors are the policy's.)
    """
    limits = task.policy.stepwise
    scatter = math.sqrt(1.0 - best.phi**2) * min(best.rmse, task.camera)
    common = math.sqrt(task.camera**2 - scatter**2)
    return max(
        limits.numerical_error_rad,
        limits.film_error_first_sigmas * task.camera,
        limits.film_common_error_first_sigmas * common,
        limits.model_error_share * first.cross_validated.rmse,
    )


def rank_candidates(task: Task, now: Assessment) -> list[Candidate]:
    """Fit the forecast effects, each in addition to those of the model, and rank them by evidence.

    In a film several effects may be equivalent: their predictions differ from the best one's by less than the angle's
    uncertainty, and their evidence is nearly as strong. The one with the fewest parameters then comes first.
    """
    found = fit_candidates(
        now.fit,
        now.cross_validated,
        task.fitted,
        task.predicted,
        now.forecasts,
        task.camera,
        task.policy,
        now.residual_test.competing,
    )
    if not found or task.camera == 0.0:
        return found
    near = [one for one in found if found[0].evidence - one.evidence <= task.policy.stepwise.alias_evidence_nat]
    alike = [one for one in near if rms_difference(one.fit, found[0].fit) <= task.camera]
    first = min(alike, key=lambda one: len(one.effect.parameters))
    return [first, *(one for one in found if one is not first)]


def add_effects(task: Task, first: Assessment, now: Assessment, candidates: Sequence[Candidate]) -> Assessment:
    """Add effects as long as the best candidate is significant.

    Parameters
    ----------
    task : Task
        Recordings, ledger and policy.
    first : Assessment
        Of the base model.
    now : Assessment
        Of the model to which effects are added.
    candidates : sequence of Candidate
        For that model; empty if nothing is missing.

    Returns
    -------
    Assessment
        Of the final model.
    """
    negligible, visited = smallest_structure(task, first), [now]
    most = task.policy.stepwise.most_effects
    while candidates:
        best = candidates[0]
        least = negligible if effects_of(now.fit) else smallest_first_effect(task, first, best.fit)
        if not _significant(task, now, candidates, least):
            # one effect may mask another: neither improves the prediction alone, but both together do
            if len(effects_of(now.fit)) + 2 > most:
                break
            _, more = _next(task, _add(task, best), negligible)
            if not more or not _significant(task, now, more, negligible):
                break
            best = more[0]
        added = _add(task, best)
        if not sizes_determined(added.fit, task.fitted, task.policy):
            candidates = candidates[1:]
            continue
        if _names(added) in map(_names, visited):  # effects replace each other without end
            return min(visited, key=lambda one: one.cross_validated.robust_sigma)
        visited.append(added)
        now, candidates = _next(task, added, negligible)
    return now


def add_more_effects(task: Task, first: Assessment, now: Assessment) -> Assessment:
    """Look for candidates for a model, and add effects as `add_effects` does."""
    now, candidates = _next(task, now, smallest_structure(task, first))
    return add_effects(task, first, now, candidates)


def _names(one: Assessment) -> set[str]:
    return {effect.id for effect in effects_of(one.fit)}


def _significant(task: Task, now: Assessment, candidates: Sequence[Candidate], least: float) -> bool:
    """Return whether the first candidate fits better than noise would, and predicts better by ``least``, rad RMS."""
    best = candidates[0]
    if now.residual_test.chance(best.effect, best.log_likelihood_gain) >= now.residual_test.level:
        return False
    validated = [(one.cross_validated, one.penalty) for one in candidates if one.cross_validated is not None]
    if best.cross_validated is None:
        return False
    after = chosen_without(*zip(*validated, strict=True))
    return predicts_better(now.cross_validated, after, least, task.rng, task.policy)


def _add(task: Task, best: Candidate) -> Assessment:
    """Assess the candidate's model without each earlier effect that does not improve its prediction."""
    task.progress(Stage(f"adding {best.effect.id}"))
    fit, cross_validated = best.fit, best.cross_validated
    for effect in effects_of(fit)[:-1]:
        if cross_validated is None:
            break
        reduced = refit_without(fit, effect, task.fitted)
        if not is_possible(reduced, task.fitted):
            continue
        _, fewer = predict_held_out(reduced, task.fitted, task.predicted, task.policy)
        if not predicts_better(fewer, cross_validated, 0.0, task.rng, task.policy):
            fit, cross_validated = reduced, fewer
    return assess(task, fit)


def _next(task: Task, now: Assessment, negligible: float, *, again: bool = True) -> tuple[Assessment, list[Candidate]]:
    """Return the candidates to add next, and the model; once, the model is fitted again if a candidate improves it."""
    limits = task.policy.stepwise
    if now.residual_test.passed or now.fit.rmse <= negligible or len(effects_of(now.fit)) == limits.most_effects:
        return now, []
    candidates = rank_candidates(task, now)
    better = fit_from_candidates(now.fit, candidates, task.fitted)
    if again and log_likelihood_gain(now.fit.cost, better.cost, len(better.white)) > limits.better_minimum_nat:
        return _next(task, assess(task, better), negligible, again=False)
    return now, candidates


def _noise_phi(task: Task, fit: Fit, prediction_changes: Sequence[Change]) -> tuple[float, bool]:
    """Return the AR(1) coefficient of the noise, and whether it is that of the best model's residual.

    It is limited by that of the noise floor.

    Structure that a model lacks makes its residual look correlated, and the residual of the best candidate looks least
    so. AR(1) noise is rough and structure is smooth, so the residual's roughness limits how much of its correlation can
    be noise; but not in a film, whose errors follow the motion and are smooth, too. A rest, or the distance from the
    pivot, is independent of any model; its AR(1) coefficient is another limit.
    """
    limits = task.policy.stepwise
    likely = forecasts(fit, directions(fit, task.fitted, prediction_changes, task.policy))[: limits.noise_models]
    fits = [
        fit,
        *map_in_threads(lambda one: fit_with(fit, task.fitted, one, staged=False, policy=task.policy), likely),
    ]
    best = min(fits, key=lambda one: one.cost)
    phi = autoregression(best.residuals, RESIDUAL).phi
    if not (task.floor and task.floor.filmed):
        phi *= correlated_share(best.residuals)
    if task.floor is not None and math.isfinite(task.floor.phi_error):
        most = max(0.0, task.floor.phi + limits.noise_floor_phi_errors * task.floor.phi_error)
        return min(phi, most), phi <= most
    return phi, True


def applicable(records: Sequence[Record], rate: float = 1.0) -> list[Effect]:
    """List the effects that recordings can show, at the scale of a plant ``rate`` times as fast as usual.

    A free swing has no command and distinguishes little, and an angle series without pixels has no rows. An effect that
    changes the angle as a wrong zero does is listed only if the zero is declared.
    """
    driven = any(r.command is not None for r in records)
    known = all(r.zero_known for r in records)
    fixed = {} if known else {p.name: p.null for e in LEDGER for p in e.parameters if p.mimics_zero_offset}
    upright = next((r.mass_from_upright for r in records if r.mass_from_upright is not None), None)
    if upright is not None:
        fixed["gravity_deg"] = upright
    width = max(STILL, *(float(np.ptp(r.angle)) for r in records))
    swing = width / min(max(width, NARROW), WIDE)
    return [
        e
        for e in (entry.with_fixed(fixed).at_scale(rate, swing) for entry in LEDGER)
        if e.parameters
        and (driven or e.port not in ("command", "lag", "servo"))
        and (driven or e.in_free_swing)
        and all(e.needs(r.view) for r in records)
    ]
