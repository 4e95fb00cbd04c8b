"""Block cross-validation: predictions of frames that a model was not fitted to, and the gain of one model over another.

Every frame is predicted in a free run by a model that was fitted without it. Recordings that are declared as held out
are predicted by the model of all others. The others are divided into blocks, and every fifth block is predicted by a
fit to the remaining four fifths, five times in turn. If longer blocks were left out, the remaining frames might not
determine a parameter, such as a limit that is reached once, and the prediction would err because of that and not
because of what the model lacks. Stone, J. R. Statist. Soc. B 36, 1974; Burman, Chow, Nolan, Biometrika 81, 1994.

A prediction runs free through the block from the frames before it, so the frames beside a block inform its prediction
only through the parameters. The response of a mechanism to one command is longer than a block, so no block contains
all of it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from anglecam.data.record import Record
from anglecam.data.typing import Floats
from anglecam.errors import RigError
from anglecam.identification.fit import Fit, whiten
from anglecam.identification.joined import join
from anglecam.identification.output_error import fit_output_error, predict_output_error
from anglecam.loop.policy import DEFAULT, Policy

DRAWS = 999
"""Bootstrap draws."""
FIRST_FRAMES = 8
"""Frames at the start of a recording that are never left out, because they determine its initial velocity."""
NEVER_LEFT_OUT = -1
"""Fold number of those frames."""
MAD = 1.4826
"""Ratio of the standard deviation of normal noise to its median absolute value."""


@dataclass(frozen=True)
class Prediction:
    """Prediction of recordings by a model that was not fitted to them."""

    records: tuple[Record, ...]
    """The predicted frames of each recording."""
    residuals: tuple[Floats, ...]
    """Measured minus predicted angle of each recording, (n,) each, rad."""
    cost: float
    """Sum of squared whitened residuals, rad²."""
    phi: float = 0.0
    """AR(1) coefficient of the noise, frame to frame."""
    folds: tuple[NDArray[np.int_], ...] = ()
    """Fold in which each frame was left out, (n,) for each recording; empty if none was cross-validated."""
    training: tuple[tuple[float, int], ...] = ()
    """Cost of the fit that predicted each fold, rad², and the number of frames that it was fitted to."""

    @property
    def rmse(self) -> float:
        """Root mean square residual, rad."""
        return float(np.sqrt(np.mean(np.concatenate(self.residuals) ** 2)))

    def clipped(self, most: float) -> Prediction:
        """Return the prediction with errors of at most ``most``, rad, for comparisons only; it no longer diverges."""
        clipped = tuple(np.clip(np.nan_to_num(one, nan=most), -most, most) for one in self.residuals)
        return replace(self, residuals=clipped, cost=math.nan)

    @property
    def robust_sigma(self) -> float:
        """`robust_sigma` of ``residuals``."""
        return robust_sigma(self.residuals)


@dataclass(frozen=True)
class Gain:
    """Relative reduction of the RMS prediction error, 1 − after/before."""

    ratio: float
    interval_95: tuple[float, float]
    """Bootstrap interval of ``ratio``."""
    lower_bound: float
    """Quantile of the bootstrapped ``ratio`` at the policy's ``false_gain_rate``; above zero the prediction is
    significantly better. NaN if a prediction diverges."""


def robust_sigma(residuals: Sequence[Floats]) -> float:
    """Return the standard deviation, rad, from the median absolute residual; a few outliers do not affect it."""
    return float(MAD * np.median(np.abs(np.concatenate(residuals))))


def split_records(records: Sequence[Record], held_out: Sequence[str]) -> tuple[list[Record], list[Record]]:
    """Divide recordings into those to fit and those to predict only.

    Parameters
    ----------
    records : sequence of Record
        All recordings.
    held_out : sequence of str
        Names to predict only.

    Returns
    -------
    fitted, predicted : list of Record
        The first is never empty; the second is empty if ``held_out`` is.

    Raises
    ------
    RigError
        If nothing is left to fit.
    """
    fitted = [r for r in records if r.name not in held_out]
    if not fitted:
        raise RigError("every recording is held out; nothing is left to fit")
    return fitted, [r for r in records if r.name in held_out]


def predict_held_out(
    fit: Fit, fitted: Sequence[Record], held_out: Sequence[Record], policy: Policy = DEFAULT
) -> tuple[Prediction, Prediction]:
    """Predict every recording by a model that was not fitted to it.

    Parameters
    ----------
    fit : Fit
        Of all of ``fitted``.
    fitted : sequence of Record
        Recordings to cross-validate block by block.
    held_out : sequence of Record
        Recordings that ``fit`` predicts; may be empty.
    policy : Policy
        Thresholds.

    Returns
    -------
    held_out, cross_validated : Prediction
        Of the held-out recordings (of all frames if there are none), and of all frames.
    """
    folds = _cross_validate(fit, fitted, policy)
    if not held_out:
        return folds, folds
    predicted = predict_output_error(fit, held_out)
    declared = Prediction(tuple(held_out), predicted.residuals, predicted.cost, fit.phi)
    all_frames = Prediction(
        declared.records + folds.records,
        declared.residuals + folds.residuals,
        declared.cost + folds.cost,
        fit.phi,
        tuple(np.full(len(r.time), NEVER_LEFT_OUT) for r in held_out) + folds.folds,
        folds.training,
    )
    return declared, all_frames


def chosen_without(predictions: Sequence[Prediction], penalties: Sequence[float]) -> Prediction:
    """Return the prediction of each fold by the model that explains the other folds best.

    The choice between the models, like their parameters, is then made without the frames that are predicted. Varma and
    Simon, BMC Bioinformatics 7, 2006, 91.

    Parameters
    ----------
    predictions : sequence of Prediction
        All frames of the same recordings by several models, from `predict_held_out`; the first model is the choice on
        all fitted recordings, and predicts those that are held out.
    penalties : sequence of float
        Subtracted from the log-likelihood of each model, nat.

    Returns
    -------
    Prediction
        Of the same frames; its ``cost`` is NaN.
    """
    first = predictions[0]
    residuals = [part.copy() for part in first.residuals]
    for fold in range(len(first.training)):
        likelihoods = [
            -0.5 * one.training[fold][1] * math.log(max(one.training[fold][0], 1e-300)) - penalty
            for one, penalty in zip(predictions, penalties, strict=True)
        ]
        best = predictions[int(np.argmax(likelihoods))]
        for part, folds, other in zip(residuals, first.folds, best.residuals, strict=True):
            part[folds == fold] = other[folds == fold]
    return Prediction(first.records, tuple(residuals), math.nan, first.phi)


def _cross_validate(fit: Fit, records: Sequence[Record], policy: Policy) -> Prediction:
    """Predict every recording except its first frames, each fold by a fit to the other folds."""
    errors, training = [np.zeros(len(r.time)) for r in records], []
    fold_of, joined = [fold_numbers(r, fit.phi, policy) for r in records], join(records, fit.phi)
    for fold in range(policy.cross_validation.folds):
        train = [record.only(folds != fold) for record, folds in zip(records, fold_of, strict=True)]
        trained = fit_output_error(fit.model, train, [fit.parameters], nuisance=fit.nuisance, phi=fit.phi)
        training.append((trained.cost, len(trained.white)))
        predicted = joined.predict(trained.model, trained.parameters, joined.stack(trained.nuisance)).angle
        for left, folds, error in zip(joined.runs.split(joined.angle - predicted), fold_of, errors, strict=True):
            error[folds == fold] = left[folds == fold]
    kept = [folds != NEVER_LEFT_OUT for folds in fold_of]
    tested = tuple(record.only(keep) for record, keep in zip(records, kept, strict=True))
    residuals = tuple(error[keep] for error, keep in zip(errors, kept, strict=True))
    left_out = tuple(folds[keep] for folds, keep in zip(fold_of, kept, strict=True))
    with np.errstate(over="ignore"):  # a prediction may diverge if the training frames do not determine a parameter
        white = [whiten(record, fit.phi, error) for record, error in zip(tested, residuals, strict=True)]
        return Prediction(tested, residuals, float(sum(e @ e for e in white)), fit.phi, left_out, tuple(training))


def _uncorrelated_s(record: Record, phi: float, policy: Policy) -> float:
    """Return the distance, s, from which on AR(1) noise counts as uncorrelated; it correlates by 1/e over −Δt/ln φ."""
    correlated = -record.interval / math.log(phi) if phi > 0.0 else 0.0
    return policy.cross_validation.noise_correlation_times * correlated


def block_s(record: Record, phi: float, policy: Policy) -> float:
    """Return the length of a block that is left out, s: at least a frame, at most one block for each fold."""
    first = record.time[min(FIRST_FRAMES, len(record.time) - 1)]
    most = float(record.time[-1] - first) / policy.cross_validation.folds
    wanted = max(policy.cross_validation.left_out_s, _uncorrelated_s(record, phi, policy))
    return max(min(wanted, most), record.interval)


def fold_numbers(record: Record, phi: float, policy: Policy) -> NDArray[np.int_]:
    """Return the fold in which each frame is left out, (n,); `NEVER_LEFT_OUT` for the first frames.

    A block is long enough that its noise is not correlated with that of the frames around it.
    """
    count = policy.cross_validation.folds
    first = record.time[min(FIRST_FRAMES, len(record.time) - 1)]
    blocks = np.floor((record.time - first) / block_s(record, phi, policy)).astype(int)
    return np.where(blocks < 0, NEVER_LEFT_OUT, blocks % count)


def predicts_better(
    before: Prediction, after: Prediction, least: float, rng: np.random.Generator, policy: Policy = DEFAULT
) -> bool:
    """Return whether one prediction is significantly better than another, and by at least ``least``, rad RMS.

    Larger errors count as `CrossValidationPolicy.outlier_sigmas` of the earlier model's robust standard deviation. A
    few left-out frames may hold everything that determines a parameter. A fit without them then predicts them wildly,
    which says nothing against the effect: the other frames decide.

    Parameters
    ----------
    before, after, rng, policy
        As of `compare`.
    least : float
        rad.
    """
    most = policy.cross_validation.outlier_sigmas * before.robust_sigma
    if not math.isfinite(most):  # most of it diverges
        return math.isfinite(after.robust_sigma)
    before, after = before.clipped(most), after.clipped(most)
    gain = compare(before, after, rng, policy, most)
    return before.rmse**2 - after.rmse**2 > least**2 and gain.lower_bound > 0.0


def compare(
    before: Prediction,
    after: Prediction,
    rng: np.random.Generator,
    policy: Policy = DEFAULT,
    clipped_at: float = math.inf,
) -> Gain:
    """Compare two predictions of the same recordings by a paired wild bootstrap of blocks.

    Let e be the errors after and e + δ those before. The sum of squares then falls by Σ(δ² + 2δe). The motion, and with
    it δ, is fixed; the noise in e is random, and the bootstrap gives its contribution in each block a random sign.

    Parameters
    ----------
    before, after : Prediction
        Of the same recordings.
    rng : numpy.random.Generator
        For the signs (Wu, Ann. Statist. 14, 1986).
    policy : Policy
        Thresholds.
    clipped_at : float
        Size, rad, at which errors were clipped. Such an error is a wrong prediction and no noise, so it has no random
        sign.

    Returns
    -------
    Gain
        With its 95 % interval.
    """
    cross = []
    for record, old, new in zip(before.records, before.residuals, after.residuals, strict=True):
        apart = max(policy.cross_validation.independence_s, _uncorrelated_s(record, after.phi, policy))
        size = max(1, round(apart / record.interval))
        product = (old - new) * np.where(np.abs(new) < clipped_at, new, 0.0)
        cross += [np.sum(product[i : i + size]) for i in range(0, len(new), size)]
    # errors of a diverging prediction are not finite; its gain is then nothing, or everything over a diverging one
    with np.errstate(over="ignore", invalid="ignore"):
        left = sum(float(new @ new) for new in after.residuals)
        fall = sum(float(old @ old) for old in before.residuals) - left
    falls = fall + 2.0 * rng.choice([-1.0, 1.0], size=(DRAWS, len(cross))) @ np.array(cross)
    low, high = np.quantile(falls, [0.025, 0.975])
    lower_bound = np.quantile(falls, policy.cross_validation.false_gain_rate)

    def ratio(by: float) -> float:
        """Return the ratio of a fall of the sum of squares."""
        return float(1.0 - np.sqrt(left / max(left + by, 1e-3 * left))) if left > 0.0 else float(by > 0.0)

    return Gain(ratio(fall), (ratio(low), ratio(high)), ratio(lower_bound))
