"""The loop: fit, test the residual, name the effect, add it, prove it on what was not fitted, and again.

    base fit → gate → candidates → prediction of what was not fitted → accept → gate → …

An effect is added only where the gate says that something is missing *and* the error on what the model was not fitted
to falls with a 95 % interval above zero. What remains after that, and would still be seen, is
``unexplained``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from anglecam.effects import LEDGER, Effect
from anglecam.estimate.noise import Noise, autoregression, noise_floor
from anglecam.estimate.output_error import Fit, fit_output_error
from anglecam.estimate.record import Record
from anglecam.estimate.shooting import drifts, goes_astray, windows
from anglecam.estimate.start import start_parameters
from anglecam.loop.attribute import (
    Candidate,
    fit_candidates,
    fit_with,
    log_likelihood_gain,
    promising,
    rivals,
    side_by_side,
)
from anglecam.loop.gate import LEVEL, Gate, test_residual
from anglecam.loop.holdout import Gain, Prediction, compare, predict_unseen, split_records
from anglecam.loop.screen import Change, Forecast, changes, directions, forecasts
from anglecam.simulate.plant import Plant

MOST_EFFECTS = 3
LIKELIEST = 2
"""Effects that are fitted to see what colour the noise has."""
NEGLIGIBLE = 2.0
"""In a film, structure smaller than this many times the angle's stated uncertainty is neither traced nor called
unexplained: it may be the measurement's own."""
SURE = 0.01
"""After an effect has proven itself, what remains must be this improbable as noise to be traced further, or to take the
verdict back."""
CONTRADICTED = 3.0
"""A model that errs this many times more on what was held out than on what was fitted lacks something there."""
FAITHFUL = 0.01
"""No structure smaller than this share of what the base model leaves is traced: no model of an effect is truer."""
REMAINDER, REMAINDER_UNDRIVEN = 0.1, 0.75
"""After an effect has proven itself, what remains must also be this share of what the base model left, or it does not
take the verdict back. Where nothing is commanded, or nothing tells the noise, most of it may be what no model of a
mechanism holds, such as the hand that let go."""
FINEST = math.radians(1e-3)
"""No structure smaller than this is traced: forward models and files are not much finer."""


@dataclass(frozen=True)
class Accepted:
    """An effect that was added."""

    effect: Effect
    rivals: dict[str, Fit]
    """What it cannot be told from: the model with each of these in its place, on the fitted recordings."""

    @property
    def alias_set(self) -> tuple[str, ...]:
        """Ids, its own first."""
        return (self.effect.id, *self.rivals)


@dataclass(frozen=True)
class Verdict:
    """What the loop found."""

    verdict: str
    """``attributed``, ``nothing_missing`` or ``unexplained``."""
    accepted: tuple[Accepted, ...]
    before: Fit
    """The base model on the fitted recordings."""
    after: Fit
    """The final model on the same."""
    before_held_out: Prediction
    after_held_out: Prediction
    gain: Gain
    first_gate: Gate
    last_gate: Gate
    candidates: tuple[Candidate, ...]
    """Those of the first round, strongest evidence first; none where the gate found nothing missing."""
    noise: Noise
    fitted: tuple[Record, ...]
    held_out: tuple[Record, ...]
    """By declaration; may be none."""


@dataclass(frozen=True)
class _Round:
    """A model and what its residual says."""

    fit: Fit
    told: Prediction
    unseen: Prediction
    gate: Gate
    forecasts: list[Forecast]


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
        return _close(records, held_out, starts, np.random.default_rng(seed), progress)


def _close(
    records: Sequence[Record],
    held_out: Sequence[str],
    starts: Sequence[np.ndarray],
    rng: np.random.Generator,
    progress: Callable[[str], None],
) -> Verdict:
    fitted, predicted = split_records(records, held_out)
    plant = Plant(driven=any(r.command is not None for r in fitted))
    progress("base model")
    own_starts = [s[: plant.base_count] for s in starts]
    base = fit_output_error(plant, fitted, [*start_parameters(fitted), *own_starts])
    floor = noise_floor(fitted)
    if drifts(base.parameters, fitted) or goes_astray(base, fitted):
        fitted, predicted = windows(fitted, base.parameters), windows(predicted, base.parameters)
        base = fit_output_error(plant, fitted, [base.parameters, *own_starts])
    ledger = applicable([*fitted, *predicted])
    camera = floor.sigma if floor and floor.filmed else 0.0

    def look(fit: Fit, accepted: Sequence[Accepted]) -> _Round:
        left = [e for e in ledger if e not in [a.effect for a in accepted]]
        moved = changes(fit, fitted, left)
        fit = _recolour(fit, fitted, _colour(fit, fitted, moved, floor))
        ways = directions(fit, fitted, moved)
        told, unseen = predict_unseen(fit, fitted, predicted)
        return _Round(fit, told, unseen, test_residual(fit, fitted, ways, rng), promising(forecasts(fit, ways)))

    progress("residual")
    first = now = look(base, ())
    negligible = max(FINEST, NEGLIGIBLE * camera, FAITHFUL * first.unseen.rmse)
    candidates: list[Candidate] = []
    if not first.gate.passed:
        progress("candidates")
        candidates = fit_candidates(now.fit, now.unseen, fitted, predicted, now.forecasts)
    first_candidates, accepted = tuple(candidates), list[Accepted]()

    def convincing(before: _Round, best: Candidate) -> bool:
        # a second left out may hold all that tells of a limit, which what was declared then does
        pairs = ((before.told, best.told), (before.unseen, best.unseen))
        return any(
            then is not None
            and now.rmse**2 - then.rmse**2 > negligible**2
            and compare(now, then, rng).interval_95[0] > 0.0
            for now, then in pairs[0 if predicted else 1 :]
        )

    def add(best: Candidate, accepted: list[Accepted]) -> tuple[_Round, list[Accepted], list[Candidate]]:
        progress(f"adding {best.effect.id}")
        accepted = [*accepted, Accepted(best.effect, {})]
        fit = best.fit
        if best.unseen is not None:
            fit, accepted = _without_the_needless(fit, best.unseen, accepted, fitted, predicted, rng)
        then = look(fit, accepted)
        if then.gate.p_value >= SURE or len(accepted) == MOST_EFFECTS:
            return then, accepted, []
        return then, accepted, fit_candidates(then.fit, then.unseen, fitted, predicted, then.forecasts)

    while candidates:
        proven = now
        if convincing(proven, candidates[0]):
            now, accepted, candidates = add(candidates[0], accepted)
            continue
        # one effect may mask another: neither helps alone, and both do together
        if len(accepted) + 2 > MOST_EFFECTS:
            break
        _, both, more = add(candidates[0], accepted)
        if not more or not convincing(proven, more[0]):
            break
        now, accepted, candidates = add(more[0], both)
    progress("verdict")
    # both ends are compared under the colour of the noise that the better model leaves
    before = _recolour(first.fit, fitted, now.fit.phi)
    before_told, _ = predict_unseen(before, fitted, predicted)
    noise = floor or replace(autoregression(now.fit.residuals, "residual"), sigma=now.fit.rmse)
    level = SURE if accepted else LEVEL
    structured = now.gate.p_value < level and now.fit.rmse**2 > camera**2 + negligible**2
    share = REMAINDER if plant.driven and floor is not None else REMAINDER_UNDRIVEN
    # told by the noise floor, whatever shape it has, and by what explains most of it, which is finer
    structured &= (
        not accepted
        or _beyond(now.unseen, noise) > share * _beyond(first.unseen, noise)
        or _could_still_gain(now, before) > share**2
    )
    remains = structured or now.told.rmse > CONTRADICTED * max(now.fit.rmse, negligible)
    if remains:  # nothing is named, so nothing is added
        accepted = []
    after, after_told = (before, before_told) if remains else (now.fit, now.told)
    return Verdict(
        "unexplained" if remains else "attributed" if accepted else "nothing_missing",
        _with_aliases(after, accepted, fitted, ledger),
        before,
        after,
        before_told,
        after_told,
        compare(before_told, after_told, rng),
        first.gate,
        now.gate,
        first_candidates,
        noise,
        tuple(fitted),
        tuple(predicted),
    )


def _beyond(prediction: Prediction, noise: Noise) -> float:
    """Return what a prediction errs by beyond the noise, rad."""
    return math.sqrt(max(prediction.rmse**2 - noise.sigma**2, 0.0))


def _could_still_gain(now: _Round, before: Fit) -> float:
    """Return what one more effect is forecast to explain, as a share of it and all that was explained since before."""
    if not now.forecasts or now.forecasts[0].gain <= 0.0:
        return 0.0
    more = now.forecasts[0].gain
    return more / (more + max(log_likelihood_gain(before.cost, now.fit.cost, len(before.white)), 0.0))


def applicable(records: Sequence[Record]) -> list[Effect]:
    """List the effects that recordings can show: a free swing has no command, a series without marks no rows."""
    driven = any(r.command is not None for r in records)
    known = all(r.zero_known for r in records)
    return [
        e
        for e in LEDGER
        if (driven or e.port not in ("command", "lag", "servo"))
        and (known or e.id != "constant_torque")
        and all(e.needs(r.view) for r in records)
    ]


def _colour(base: Fit, records: Sequence[Record], moved: Sequence[Change], floor: Noise | None) -> float:
    """Return the noise's φ: of the best model's residual, but no more than the noise floor's.

    What a model lacks makes its residual look coloured; the best candidate's residual looks least so, and a rest or
    the distance from the pivot, which no model enters, says where colour ends and structure begins.
    """
    likely = forecasts(base, directions(base, records, moved))[:LIKELIEST]
    fits = [base, *side_by_side(lambda one: fit_with(base, records, one), likely)]
    best = min(fits, key=lambda fit: fit.cost)
    phi = autoregression(best.residuals, "residual").phi
    return phi if floor is None else min(phi, max(0.0, floor.phi + 1.645 * floor.phi_error))


def _recolour(fit: Fit, records: Sequence[Record], phi: float) -> Fit:
    return fit_output_error(fit.model, records, [fit.parameters], own=fit.own, phi=phi)


def _reduced(fit: Fit, effect: Effect, records: Sequence[Record]) -> Fit:
    """Fit the plant again without one of its effects."""
    if not isinstance(fit.model, Plant):
        raise TypeError("only a Plant has effects")
    own = [p.name for p in effect.parameters]
    keep = [i for i, name in enumerate(fit.model.names) if name not in own]
    smaller = replace(fit.model, effects=tuple(e for e in fit.model.effects if e is not effect))
    return fit_output_error(smaller, records, [fit.parameters[keep]], own=fit.own, phi=fit.phi)


def _without_the_needless(
    fit: Fit,
    unseen: Prediction,
    accepted: list[Accepted],
    fitted: Sequence[Record],
    predicted: Sequence[Record],
    rng: np.random.Generator,
) -> tuple[Fit, list[Accepted]]:
    """Take back each effect, first to last, without which the unseen is predicted as well."""
    for entry in accepted[:-1]:
        reduced = _reduced(fit, entry.effect, fitted)
        _, without = predict_unseen(reduced, fitted, predicted)
        if compare(without, unseen, rng).interval_95[0] <= 0.0:
            fit, unseen, accepted = reduced, without, [a for a in accepted if a is not entry]
    return fit, accepted


def _with_aliases(
    fit: Fit, accepted: Sequence[Accepted], records: Sequence[Record], ledger: Sequence[Effect]
) -> tuple[Accepted, ...]:
    """Say of every effect, the others in place, what it cannot be told from."""
    told = []
    for entry in accepted:
        effects = [a.effect for a in accepted if a is not entry]
        # the effect goes last, where a candidate's parameters are
        base = _reduced(fit, entry.effect, records)
        best = _last(fit, entry.effect, records)
        left = [e for e in ledger if e not in effects and e is not entry.effect]
        others = promising(forecasts(base, directions(base, records, changes(base, records, left))))
        told.append(Accepted(entry.effect, rivals(best, base, records, entry.effect, others)))
    return tuple(told)


def _last(fit: Fit, effect: Effect, records: Sequence[Record]) -> Fit:
    """Return the same fit with one of its effects after all others."""
    plant = fit.model
    if not isinstance(plant, Plant):
        raise TypeError("only a Plant has effects")
    own = [p.name for p in effect.parameters]
    order = sorted(range(len(plant.names)), key=lambda i: plant.names[i] in own)
    moved = replace(plant, effects=tuple(sorted(plant.effects, key=lambda e: e is effect)))
    return fit_output_error(moved, records, [fit.parameters[order]], own=fit.own, phi=fit.phi)
