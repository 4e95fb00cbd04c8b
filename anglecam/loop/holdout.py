"""Recordings that are never fitted, only predicted; and how much better one model predicts them than another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from anglecam.errors import RigError
from anglecam.estimate.output_error import Fit
from anglecam.estimate.record import Record

Floats = NDArray[np.float64]

DRAWS = 999
BLOCK = 0.5
"""s; prediction errors further apart than this count as independent."""


@dataclass(frozen=True)
class Gain:
    """By how much the held-out error falls: 1 − after/before."""

    ratio: float
    interval_95: tuple[float, float]


def split_records(records: Sequence[Record], held_out: Sequence[str]) -> tuple[list[Record], list[Record]]:
    """Divide recordings into those to fit and those to predict.

    Parameters
    ----------
    records : sequence of Record
        All recordings.
    held_out : sequence of str
        Names to predict only. With none named, the last driven recording by name is held out (the last of all, if
        none is driven); if it is the only one of its kind it is cut in time, and its last third held out.

    Returns
    -------
    fitted, predicted : list of Record
        Neither is empty.

    Raises
    ------
    RigError
        Where nothing would be left to fit.
    """
    if held_out:
        predicted = [r for r in records if r.name in held_out]
        fitted = [r for r in records if r.name not in held_out]
        if not fitted:
            raise RigError("every recording is held out; nothing is left to fit")
        if predicted:
            return fitted, predicted
    kind = [r for r in records if r.command is not None] or list(records)
    last = max(kind, key=lambda r: r.name)
    others = [r for r in records if r is not last]
    if len(kind) > 1:
        return others, [last]
    cut = float(last.time[2 * len(last.time) // 3])
    rest = replace(last.between(cut, np.inf), name=f"{last.name}, last third")
    return [*others, last.between(-np.inf, cut)], [rest]


def held_out_gain(before: Fit, after: Fit, records: Sequence[Record], rng: np.random.Generator) -> Gain:
    """Compare two predictions of the same recordings by a paired block bootstrap.

    Parameters
    ----------
    before, after : Fit
        Predictions, recording by recording.
    records : sequence of Record
        What was predicted.
    rng : numpy.random.Generator
        For the draws of blocks (Künsch, Ann. Statist. 17, 1989).

    Returns
    -------
    Gain
        With its 95 % interval.
    """
    pairs = []
    for record, old, new in zip(records, before.residuals, after.residuals, strict=True):
        size = max(1, round(BLOCK / record.interval))
        starts = range(0, len(old), size)
        pairs += [(np.sum(old[i : i + size] ** 2), np.sum(new[i : i + size] ** 2)) for i in starts]
    energy = np.array(pairs)
    picks = rng.integers(len(energy), size=(DRAWS, len(energy)))
    sums = energy[picks].sum(axis=1)
    ratios = 1.0 - np.sqrt(sums[:, 1] / sums[:, 0])
    total = energy.sum(axis=0)
    low, high = np.quantile(ratios, [0.025, 0.975])
    return Gain(float(1.0 - np.sqrt(total[1] / total[0])), (float(low), float(high)))
