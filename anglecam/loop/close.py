"""The loop: fit, test the residual, name the effect, add it, prove it on held-out recordings, and again.

    base fit → gate → candidates → evidence → held-out gain → accept → gate → …

An effect is added only where the gate says that something is missing *and* the held-out error falls with a 95 %
interval above zero. What remains after that, and would still be seen, is ``unexplained``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from anglecam.effects import LEDGER, Effect
from anglecam.estimate.noise import DISTANCE, Noise, autoregression, stated_noise, witness_noise
from anglecam.estimate.output_error import Fit, fit_output_error, predict_output_error
from anglecam.estimate.record import Record
from anglecam.estimate.start import start_parameters
from anglecam.loop.attribute import Candidate, alias_set, fit_candidates, fit_with
from anglecam.loop.gate import LEVEL, Gate, test_residual
from anglecam.loop.holdout import Gain, held_out_gain, split_records
from anglecam.simulate.plant import Plant

MOST_EFFECTS = 3
NEGLIGIBLE = 0.5
"""In a film, structure smaller than this share of the noise is neither traced nor called unexplained: the pixel grid
leaves that much along the path, the same wherever the mouth passes, which it does not leave across it."""
SURE = 0.01
"""After an effect has proven itself, what remains must be this improbable as noise to take the verdict back."""
CONTRADICTED = 3.0
"""A model that errs this many times more on what was held out than on what was fitted lacks something there."""
FINEST = math.radians(1e-3)
"""No structure smaller than this is traced: forward models and files are not much finer."""


@dataclass(frozen=True)
class Accepted:
    """An effect that was added."""

    effect: Effect
    alias_set: tuple[str, ...]


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
    before_held_out: Fit
    after_held_out: Fit
    gain: Gain
    first_gate: Gate
    last_gate: Gate
    candidates: tuple[Candidate, ...]
    """Those of the first round, strongest evidence first."""
    noise: Noise
    fitted: tuple[Record, ...]
    held_out: tuple[Record, ...]


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
        Names that are predicted only; see `split_records` for what happens without.
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
    rng = np.random.default_rng(seed)
    fitted, predicted = split_records(records, held_out)
    driven = any(r.command is not None for r in fitted)
    plant = Plant(driven=driven)
    ledger = [e for e in LEDGER if driven or e.shift_command is None]
    witness = witness_noise(fitted)
    camera = witness.sigma if witness and witness.source == DISTANCE else 0.0
    negligible = max(FINEST, NEGLIGIBLE * camera)

    progress("base model")
    own_starts = [s[: plant.base_count] for s in starts]
    white_fit = fit_output_error(plant, fitted, [*start_parameters(fitted), *own_starts])

    def colour(base: Fit, effects: Sequence[Effect]) -> float:
        return _colour(base, fitted, effects, witness)

    progress("noise")
    before = _recolour(white_fit, fitted, colour(white_fit, ledger))
    progress("residual")
    first_gate = gate = test_residual(before, fitted, ledger, rng)
    progress("candidates")
    first = candidates = fit_candidates(before, fitted, predicted, ledger)
    fit = before
    accepted: list[Accepted] = []
    while not gate.passed and len(accepted) < MOST_EFFECTS and candidates:
        best = candidates[0]
        so_far = predict_output_error(fit, predicted)
        gain = held_out_gain(so_far, best.prediction, predicted, rng)
        if gain.interval_95[0] <= 0.0 or so_far.rmse**2 - best.prediction.rmse**2 <= negligible**2:
            break
        progress(f"adding {best.effect.id}")
        accepted.append(Accepted(best.effect, tuple(alias_set(best, fit, fitted, candidates[1:]))))
        left = [e for e in ledger if e not in [a.effect for a in accepted]]
        fit = _recolour(best.fit, fitted, colour(best.fit, left))
        gate = test_residual(fit, fitted, left, rng)
        candidates = [] if gate.passed else fit_candidates(fit, fitted, predicted, left)
    progress("verdict")
    fit, accepted = _without_the_unneeded(fit, accepted, fitted, predicted, rng)
    # both ends are compared under the colour of the noise that the better model leaves
    before = _recolour(before, fitted, fit.phi)
    before_held_out, after_held_out = (predict_output_error(f, predicted) for f in (before, fit))
    noise = witness or stated_noise(fitted) or _left_over(fit)
    level = SURE if accepted else LEVEL
    structured = gate.p_value < level and fit.rmse**2 > camera**2 + negligible**2
    remains = structured or after_held_out.rmse > CONTRADICTED * max(fit.rmse, FINEST)
    if remains:  # nothing is named, so nothing is added
        fit, after_held_out = before, before_held_out
    verdict = "unexplained" if remains else "attributed" if accepted else "nothing_missing"
    return Verdict(
        verdict,
        () if remains else tuple(accepted),
        before,
        fit,
        before_held_out,
        after_held_out,
        held_out_gain(before_held_out, after_held_out, predicted, rng),
        first_gate,
        gate,
        tuple(first),
        noise,
        tuple(fitted),
        tuple(predicted),
    )


def _colour(base: Fit, records: Sequence[Record], effects: Sequence[Effect], witness: Noise | None) -> float:
    """Return the noise's φ: of the best model's residual, but no more than the witness allows.

    What a model lacks makes its residual look coloured; the best candidate's residual looks least so, and a rest or
    the distance from the pivot, which no model enters, says where colour ends and structure begins.
    """
    fits = [base, *(fit_with(base, records, effect) for effect in effects)]
    best = min(fits, key=lambda fit: fit.cost)
    phi = autoregression(best.residuals, "residual").phi
    return phi if witness is None else min(phi, max(0.0, witness.phi + 1.645 * witness.phi_error))


def _recolour(fit: Fit, records: Sequence[Record], phi: float) -> Fit:
    return fit_output_error(fit.model, records, [fit.parameters], own=fit.own, phi=phi)


def _left_over(fit: Fit) -> Noise:
    return replace(autoregression(fit.residuals, "residual"), sigma=fit.rmse)


def _without_the_unneeded(
    fit: Fit,
    accepted: list[Accepted],
    fitted: Sequence[Record],
    predicted: Sequence[Record],
    rng: np.random.Generator,
) -> tuple[Fit, list[Accepted]]:
    """Take back each effect, first to last, that later ones have made needless on held-out recordings."""
    for entry in list(accepted):
        if len(accepted) < 2 or not isinstance(fit.model, Plant):
            break
        rest = [a for a in accepted if a is not entry]
        keep = [i for i, name in enumerate(fit.model.names) if name not in [p.name for p in entry.effect.parameters]]
        smaller = replace(fit.model, effects=tuple(a.effect for a in rest))
        reduced = fit_output_error(smaller, fitted, [fit.parameters[keep]], own=fit.own, phi=fit.phi)
        gain = held_out_gain(
            predict_output_error(reduced, predicted), predict_output_error(fit, predicted), predicted, rng
        )
        if gain.interval_95[0] <= 0.0:
            fit, accepted = reduced, rest
    return fit, accepted
