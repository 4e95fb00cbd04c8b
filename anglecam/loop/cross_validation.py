"""Predictions of recordings that a model was not fitted to, and how much better one model predicts them than another.

Every frame is predicted in free run by a model that was fitted without it: recordings that are held out by declaration
by the model of all others, and of the others every fifth quarter of a second by a fit to the rest. With longer
stretches left out the rest may lack what tells a parameter, such as a limit that is reached once, and the prediction
errs by that more than by what the model lacks. Stone, J. R. Statist. Soc. B 36, 1974; Burman, Chow, Nolan, Biometrika
81, 1994.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anglecam.data.record import Record
from anglecam.data.typing import Floats
from anglecam.errors import RigError
from anglecam.identification.fit import Fit, whiten
from anglecam.identification.output_error import fit_output_error, predict_output_error, predicted_angle

DRAWS = 999
BLOCK = 0.5
"""s; prediction errors further apart than this count as independent."""
TURNS = 5
"""Times that a model is fitted to what is left."""
LEFT_OUT = 0.25
"""s; of every recording a block of this length in `TURNS` is left out at a time. As predictions run free, a block's
neighbours tell of it only by way of the parameters; a head's answer to one command is longer, so that no block takes
all of it."""


FIRST_FRAMES = 8
"""Frames that are never left out: without them nothing tells the rate that a recording starts with."""
KEPT = -1
MAD = 1.4826
"""Standard deviation of normal noise over its median absolute value."""


@dataclass(frozen=True)
class Prediction:
    """Recordings predicted by a model that was not fitted to them."""

    records: tuple[Record, ...]
    residuals: tuple[Floats, ...]
    """Measured minus predicted angle of each, rad."""
    cost: float
    """Sum of squared whitened residuals, rad²."""

    @property
    def rmse(self) -> float:
        """Root mean square residual, rad."""
        return float(np.sqrt(np.mean(np.concatenate(self.residuals) ** 2)))

    @property
    def robust_sigma(self) -> float:
        """`robust_sigma` of ``residuals``."""
        return robust_sigma(self.residuals)


@dataclass(frozen=True)
class Gain:
    """By how much the error on what was not fitted falls: 1 − after/before."""

    ratio: float
    interval_95: tuple[float, float]


def robust_sigma(residuals: Sequence[Floats]) -> float:
    """Return the standard deviation that the median absolute residual speaks of: a few frames far off do not count."""
    return float(MAD * np.median(np.abs(np.concatenate(residuals))))


def split_records(records: Sequence[Record], held_out: Sequence[str]) -> tuple[list[Record], list[Record]]:
    """Divide recordings into those to fit and those that are declared to be predicted only.

    Parameters
    ----------
    records : sequence of Record
        All recordings.
    held_out : sequence of str
        Names to predict only.

    Returns
    -------
    fitted, predicted : list of Record
        The first is not empty; the second is where nothing is declared.

    Raises
    ------
    RigError
        Where nothing would be left to fit.
    """
    fitted = [r for r in records if r.name not in held_out]
    if not fitted:
        raise RigError("every recording is held out; nothing is left to fit")
    return fitted, [r for r in records if r.name in held_out]


def predict_held_out(fit: Fit, fitted: Sequence[Record], held_out: Sequence[Record]) -> tuple[Prediction, Prediction]:
    """Predict every recording by a model that was not fitted to it.

    Parameters
    ----------
    fit : Fit
        Of all of ``fitted``.
    fitted, held_out : sequence of Record
        To predict block by block, and by ``fit`` itself.

    Returns
    -------
    told, whole : Prediction
        Of what is held out by declaration (of all where nothing is), and of all.
    """
    told = predict_output_error(fit, held_out) if held_out else None
    declared = Prediction(tuple(held_out), told.residuals, told.cost) if told else None
    turns = _in_turns(fit, fitted)
    if declared is None:
        return turns, turns
    whole = Prediction(
        declared.records + turns.records, declared.residuals + turns.residuals, declared.cost + turns.cost
    )
    return declared, whole


def _in_turns(fit: Fit, records: Sequence[Record]) -> Prediction:
    """Predict every recording but for its first frames, where the model starts, by fits without what they predict."""
    errors = [np.zeros(len(r.time)) for r in records]
    left_out = [_turns(r) for r in records]
    for turn in range(TURNS):
        train = [record.only(frames != turn) for record, frames in zip(records, left_out, strict=True)]
        left = fit_output_error(fit.model, train, [fit.parameters], nuisance=fit.nuisance, phi=fit.phi)
        for record, frames, own, error in zip(records, left_out, left.nuisance, errors, strict=True):
            told = predicted_angle(left.model, left.parameters, record, own)
            error[frames == turn] = (record.angle - told)[frames == turn]
    tested = tuple(record.only(frames != KEPT) for record, frames in zip(records, left_out, strict=True))
    residuals = tuple(error[frames != KEPT] for error, frames in zip(errors, left_out, strict=True))
    with np.errstate(over="ignore"):  # a fit to what is left may run away where nothing was left to hold it
        white = [whiten(record, fit.phi, error) for record, error in zip(tested, residuals, strict=True)]
        return Prediction(tested, residuals, float(sum(e @ e for e in white)))


def _turns(record: Record) -> NDArray[np.int_]:
    """Return for each frame the turn in which it is left out; the first few, which tell where it starts, never are."""
    first = record.time[min(FIRST_FRAMES, len(record.time) - 1)]
    length = min(LEFT_OUT, (record.time[-1] - first) / TURNS)
    turns = np.floor((record.time - first) / length).astype(int)
    return np.where(turns < 0, KEPT, turns % TURNS)


def compare(before: Prediction, after: Prediction, rng: np.random.Generator) -> Gain:
    """Compare two predictions of the same recordings by a paired wild bootstrap of blocks.

    With e the errors after and δ by how much those before differ, the energy falls by Σ(δ² + 2δe). The motion is what
    it was, and so is δ; what is random is the noise in e, whose part in every block takes either sign.

    Parameters
    ----------
    before, after : Prediction
        Of the same recordings.
    rng : numpy.random.Generator
        For the signs (Wu, Ann. Statist. 14, 1986).

    Returns
    -------
    Gain
        With its 95 % interval.
    """
    cross = []
    for record, old, new in zip(before.records, before.residuals, after.residuals, strict=True):
        size = max(1, round(BLOCK / record.interval))
        product = (old - new) * new
        cross += [np.sum(product[i : i + size]) for i in range(0, len(new), size)]
    with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is no gain, or over a runaway all of it
        left = sum(float(new @ new) for new in after.residuals)
        fall = sum(float(old @ old) for old in before.residuals) - left
    falls = fall + 2.0 * rng.choice([-1.0, 1.0], size=(DRAWS, len(cross))) @ np.array(cross)
    low, high = np.quantile(falls, [0.025, 0.975])

    def ratio(by: float) -> float:
        return float(1.0 - np.sqrt(left / max(left + by, 1e-3 * left))) if left > 0.0 else float(by > 0.0)

    return Gain(ratio(fall), (ratio(low), ratio(high)))
