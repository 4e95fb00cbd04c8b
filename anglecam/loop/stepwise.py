"""The rounds of the loop: what a model leaves over, what could be added to it, and whether that proves itself.

    residual → gate → candidates → prediction of what was not fitted → accept → residual → …

An effect is added only where the gate says that something is missing *and* the error on what the model was not fitted
to falls with a 95 % interval above zero.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from anglecam.data.record import Record
from anglecam.effects import LEDGER, Effect
from anglecam.identification.fit import Fit
from anglecam.identification.noise import Noise, autoregression
from anglecam.loop.candidates import (
    Candidate,
    fit_candidates,
    fit_from_candidates,
    fit_with,
    log_likelihood_gain,
    map_in_threads,
    promising,
    rms_difference,
)
from anglecam.loop.cross_validation import Prediction, compare, predict_held_out
from anglecam.loop.refit import effects_left, effects_of, refit_with_phi, refit_without
from anglecam.loop.residual_test import ResidualTest, run_residual_test
from anglecam.loop.screen import Change, Forecast, changes, directions, forecasts

MOST_EFFECTS = 3
LIKELIEST = 2
"""Effects that are fitted to see what colour the noise has."""
NEGLIGIBLE = 2.0
"""In a film, structure smaller than this many times the angle's stated uncertainty is neither traced further nor called
unexplained: it may be the measurement's own."""
DECISIVE = 10.0
"""Log-likelihood from which on evidence chooses between effects whose predictions a film's angle hardly tells apart."""
SURE = 0.01
"""What an effect explains must be this improbable as noise; and so must what remains once one has proven itself, to be
traced further or to take the verdict back."""
WORTH_A_LOOK = 1.0
"""Log-likelihood by which a better fit of the same model makes its residual worth testing anew."""
FAITHFUL = 0.005
"""No structure smaller than this share of what the base model leaves is traced: no model of an effect is truer."""
FINEST = math.radians(1e-3)
"""No structure smaller than this is traced: forward models and files are not much finer."""


@dataclass(frozen=True)
class Task:
    """What the loop works on."""

    fitted: tuple[Record, ...]
    predicted: tuple[Record, ...]
    """Held out by declaration; may be none."""
    ledger: tuple[Effect, ...]
    """What these recordings can show."""
    floor: Noise | None
    rng: np.random.Generator
    progress: Callable[[str], None]

    @property
    def camera(self) -> float:
        """Noise of a film's angle, rad; 0 for a series from elsewhere."""
        return self.floor.sigma if self.floor and self.floor.filmed else 0.0


@dataclass(frozen=True)
class Assessment:
    """A model and what its residual says."""

    fit: Fit
    held_out: Prediction
    """Of what is held out by declaration, or of all block by block where nothing is."""
    cross_validated: Prediction
    """Of every frame by a model that was not fitted to it."""
    residual_test: ResidualTest
    forecasts: tuple[Forecast, ...]
    """What is worth a fit, most promising first."""


def assess(task: Task, fit: Fit) -> Assessment:
    """Test what a fitted plant leaves over, whitened with the noise's colour as far as that can be told by now."""
    moved = changes(fit, task.fitted, effects_left(task.ledger, fit))
    fit = refit_with_phi(fit, task.fitted, _colour(task, fit, moved))
    ways = directions(fit, task.fitted, moved)
    told, unseen = predict_held_out(fit, task.fitted, task.predicted)
    gate = run_residual_test(fit, task.fitted, ways, task.rng, NEGLIGIBLE * task.camera)
    return Assessment(fit, told, unseen, gate, tuple(promising(forecasts(fit, ways))))


def smallest_traced(task: Task, first: Assessment) -> float:
    """Return the smallest structure that is traced, rad RMS."""
    return max(FINEST, NEGLIGIBLE * task.camera, FAITHFUL * first.cross_validated.rmse)


def smallest_first_effect(task: Task, first: Assessment, best: Fit) -> float:
    """Return the smallest doing of a first effect, rad RMS.

    In a film it must be as large as the angle's stated uncertainty, and `NEGLIGIBLE` times that part of it which does
    not scatter from frame to frame once the effect is in: only that can follow the motion as an effect does.
    """
    scatter = math.sqrt(1.0 - best.phi**2) * min(best.rmse, task.camera)
    common = math.sqrt(task.camera**2 - scatter**2)
    return max(FINEST, task.camera, NEGLIGIBLE * common, FAITHFUL * first.cross_validated.rmse)


def rank_candidates(task: Task, now: Assessment) -> list[Candidate]:
    """Fit what is promising beside what the model has, strongest evidence first.

    Of those whose predictions differ from the best's by less than a film's angle is uncertain, and whose evidence is
    nearly as strong, the one with fewest parameters comes first.
    """
    found = fit_candidates(now.fit, now.cross_validated, task.fitted, task.predicted, now.forecasts, task.camera)
    if not found or task.camera == 0.0:
        return found
    near = [one for one in found if found[0].evidence - one.evidence <= DECISIVE]
    alike = [one for one in near if rms_difference(one.fit, found[0].fit) <= task.camera]
    first = min(alike, key=lambda one: len(one.effect.parameters))
    return [first, *(one for one in found if one is not first)]


def add_effects(task: Task, first: Assessment, candidates: Sequence[Candidate]) -> Assessment:
    """Add effects for as long as one proves itself.

    Parameters
    ----------
    task : Task
        What there is to explain.
    first : Assessment
        The base model's.
    candidates : sequence of Candidate
        Its candidates; none where nothing is missing.

    Returns
    -------
    Assessment
        The best model's.
    """
    now, negligible, been = first, smallest_traced(task, first), [_names(first)]
    while candidates:
        best = candidates[0]
        if not _convincing(
            task, now, best, negligible if effects_of(now.fit) else smallest_first_effect(task, first, best.fit)
        ):
            # one effect may mask another: neither helps alone, and both do together
            if len(effects_of(now.fit)) + 2 > MOST_EFFECTS:
                break
            _, more = _next(task, _added(task, best), negligible)
            if not more or not _convincing(task, now, more[0], negligible):
                break
            best = more[0]
        added = _added(task, best)
        if _names(added) in been:  # what is taken out for it would be put in again without end
            break
        been.append(_names(added))
        now, candidates = _next(task, added, negligible)
    return now


def _names(one: Assessment) -> set[str]:
    return {effect.id for effect in effects_of(one.fit)}


def _convincing(task: Task, now: Assessment, best: Candidate, negligible: float) -> bool:
    if 2.0 * best.log_likelihood_gain <= special.chdtri(len(best.effect.parameters), SURE):
        return False  # noise would fit as well; and of two intervals one is easily above zero
    # a second left out may hold all that tells of a limit, which what was declared then does
    pairs = ((now.held_out, best.held_out), (now.cross_validated, best.cross_validated))
    return any(
        after is not None
        and before.rmse**2 - after.rmse**2 > negligible**2
        and compare(before, after, task.rng).interval_95[0] > 0.0
        for before, after in pairs[0 if task.predicted else 1 :]
    )


def _added(task: Task, best: Candidate) -> Assessment:
    """Take the candidate's model, less each earlier effect without which the unseen is predicted as well."""
    task.progress(f"adding {best.effect.id}")
    fit, unseen = best.fit, best.cross_validated
    for effect in effects_of(fit)[:-1]:
        if unseen is None:
            break
        reduced = refit_without(fit, effect, task.fitted)
        _, less = predict_held_out(reduced, task.fitted, task.predicted)
        if compare(less, unseen, task.rng).interval_95[0] <= 0.0:
            fit, unseen = reduced, less
    return assess(task, fit)


def _next(task: Task, now: Assessment, negligible: float, *, again: bool = True) -> tuple[Assessment, list[Candidate]]:
    """Look for what to add next, and on the way, once, for a better fit of what there is."""
    if now.residual_test.p_value >= SURE or now.fit.rmse <= negligible or len(effects_of(now.fit)) == MOST_EFFECTS:
        return now, []
    candidates = rank_candidates(task, now)
    deeper = fit_from_candidates(now.fit, candidates, task.fitted)
    if again and log_likelihood_gain(now.fit.cost, deeper.cost, len(deeper.white)) > WORTH_A_LOOK:
        return _next(task, assess(task, deeper), negligible, again=False)
    return now, candidates


def _colour(task: Task, fit: Fit, moved: Sequence[Change]) -> float:
    """Return the noise's φ: of the best model's residual, but no more than the noise floor's.

    What a model lacks makes its residual look coloured; the best candidate's residual looks least so, and a rest or
    the distance from the pivot, which no model enters, says where colour ends and structure begins.
    """
    likely = forecasts(fit, directions(fit, task.fitted, moved))[:LIKELIEST]
    fits = [fit, *map_in_threads(lambda one: fit_with(fit, task.fitted, one, staged=False), likely)]
    best = min(fits, key=lambda one: one.cost)
    phi = autoregression(best.residuals, "residual").phi
    return phi if task.floor is None else min(phi, max(0.0, task.floor.phi + 1.645 * task.floor.phi_error))


def applicable(records: Sequence[Record]) -> list[Effect]:
    """List the effects that recordings can show: a free swing has no command, a series without marks no rows.

    What is the same as a wrong zero of the angle can be told only where that is known.
    """
    driven = any(r.command is not None for r in records)
    known = all(r.zero_known for r in records)
    fixed = {} if known else {p.name: p.null for e in LEDGER for p in e.parameters if p.mimics_zero_offset}
    upright = next((r.mass_from_upright for r in records if r.mass_from_upright is not None), None)
    if upright is not None:
        fixed["gravity_deg"] = upright
    return [
        e
        for e in (entry.with_fixed(fixed) for entry in LEDGER)
        if e.parameters
        and (driven or e.port not in ("command", "lag", "servo"))
        and all(e.needs(r.view) for r in records)
    ]
