"""Uncertainty of parameters due to systematic errors of the measurement, which repeat and so show in no scatter.

A pivot that is wrong by k lever arms along the line to the mark turns that line, relative to neutral, by k·sin θ; a
pivot wrong across the line turns it by

    k·(1 − cos θ)

in every frame of its recording. A wrong declared neutral shifts all angles of all recordings alike, and a clock offset
of the command shifts all motion in time. Rounding to a grid lifts small waves to a whole step or hides them, always in
the same way. A fit follows such an error as if it were motion. JCGM 100:2008, 5.1.2, on uncertainties of one origin.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from anglecam.data.record import Record
from anglecam.data.typing import Floats
from anglecam.identification.fit import Fit
from anglecam.identification.noise import Noise
from anglecam.identification.quantisation import Grid, quantisation

GRIDS = 32
"""Grids drawn to estimate what rounding does to the parameters; they determine its mean square to 25 %."""


def full_sigma(fit: Fit, records: Sequence[Record], noise: Noise) -> Floats:
    """Return the (p,) standard uncertainties, SI, of a fit's parameters from scatter and from systematic errors."""
    return np.sqrt(fit.sigma**2 + np.diag(systematic_covariance(fit, records, noise)))


def systematic_covariance(fit: Fit, records: Sequence[Record], noise: Noise) -> Floats:
    """Return the parameters' covariance due to errors that are common to all angles of a recording.

    Parameters
    ----------
    fit : Fit
        Fit to ``records``.
    records : sequence of Record
        With a stated uncertainty in every frame; without it only the uncertainty of the command's clock and the
        rounding to a grid count.
    noise : Noise
        Upper limit of the part of the stated uncertainty that is independent from frame to frame.

    Returns
    -------
    (p, p) ndarray
        SI; NaN for a parameter that cannot be determined or is at a bound.
    """
    shifts = [fit.parameter_shift(records, _clock_errors(fit, records))] if any(r.clock_sigma for r in records) else []
    if (grid := quantisation(records)) is not None:
        shifts += _shifts_of_rounding(fit, records, grid)
    if all(np.isfinite(r.sigma).all() for r in records):
        shifts += _shifts_of_positions(fit, records, noise)
    count = len(fit.parameters)
    return np.sum([np.outer(shift, shift) for shift in shifts], axis=0) if shifts else np.zeros((count, count))


def _clock_errors(fit: Fit, records: Sequence[Record]) -> list[Floats]:
    """Return the angles' errors, rad, if all commands came later by the standard uncertainty of their clock."""
    return [
        r.clock_sigma * np.gradient(angle, r.time) for r, angle in zip(records, _predicted(fit, records), strict=True)
    ]


def _shifts_of_rounding(fit: Fit, records: Sequence[Record], grid: Grid) -> list[Floats]:
    """Return shifts of the parameters, SI, whose squares add up to the mean square that rounding causes.

    Where a level of the motion lies between two lines of the grid is known to a part of a step only, so the grid's
    lines are drawn.
    """
    rng, predicted, shifts = np.random.default_rng(0), _predicted(fit, records), []
    for _ in range(GRIDS):
        drawn = replace(grid, offsets=tuple(rng.uniform(0.0, grid.step, len(records)).tolist()))
        errors = [rounded - exact for rounded, exact in zip(drawn.rounded(predicted), predicted, strict=True)]
        shifts.append(fit.parameter_shift(records, errors) / math.sqrt(GRIDS))
    return shifts


def _predicted(fit: Fit, records: Sequence[Record]) -> list[Floats]:
    return [r.angle - residual for r, residual in zip(records, fit.residuals, strict=True)]


def _shifts_of_positions(fit: Fit, records: Sequence[Record], noise: Noise) -> list[Floats]:
    """Return the parameters' shifts, SI, for a neutral and pivots that are wrong by their standard uncertainties."""
    stated = np.concatenate([r.sigma for r in records])
    independent = min(noise.sigma, fit.rmse)  # errors independent from frame to frame scatter about the model
    shared = np.sqrt(max(0.0, float(np.mean(stated**2)) - independent**2))
    shifts = [shared * fit.parameter_shift(records, [np.ones(len(r.time)) for r in records])]
    for name in dict.fromkeys(r.name for r in records):
        wrong = _wrong_pivot([r for r in records if r.name == name])
        for shape in (np.sin, lambda angle: 1.0 - np.cos(angle)):
            errors = [wrong * shape(r.angle) if r.name == name else np.zeros(len(r.time)) for r in records]
            shifts.append(fit.parameter_shift(records, errors))
    return shifts


def _wrong_pivot(records: Sequence[Record]) -> float:
    """Return the pivot's standard uncertainty, in lever arms, from the growth of the stated one away from neutral."""
    sigma, angle = (np.concatenate(each) for each in ([r.sigma for r in records], [r.angle for r in records]))
    turned = float(np.sum(2.0 - 2.0 * np.cos(angle)))
    return float(np.sqrt(np.sum(sigma**2 - sigma.min() ** 2) / turned)) if turned > 0.0 else 0.0
