"""What noise alone would leave of a fit: the draws of the residual test's parametric bootstrap.

A draw is white noise, from which the column space of the fit's Jacobian is projected out, as the fit projects it out.
The errors of a quantised angle follow the motion and are not white. Their draws are the rounding errors of predicted
motions, each with other parameters among those that the recordings leave possible.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from anglecam.data.record import Record
from anglecam.data.typing import Floats
from anglecam.identification.fit import Fit
from anglecam.identification.joined import Joined, join
from anglecam.identification.noise import ar1_coefficient
from anglecam.identification.quantisation import Grid, quantisation

DRAWS = 999
"""Bootstrap draws; with the data's statistic among them p-values are multiples of 1/1000."""
PHASES = 99
"""Phases of the grid at which the size of the errors that a fit follows is estimated."""
MOST_DOUBLE = 2**25
"""Most values that all draws together keep in double precision, 256 MB; more are kept in single precision. Shares of
energy, which are sums over all frames, need no more.
"""
AT_ONCE = 2**21
"""Values of the draws that are made or multiplied at once, 16 MB. A test of fewer frames has the draws of one block."""


def data_and_draws(
    fit: Fit, records: Sequence[Record], rng: np.random.Generator, phi_estimated: bool
) -> tuple[Floats, bool]:
    """Return (N, 1 + DRAWS) residuals that the fit cannot follow, the data's first, and whether they are quantised.

    The others are those that noise alone would leave.
    """
    n, joined = len(fit.white), join(records, fit.phi)
    both = np.empty((n, 1 + DRAWS), np.float64 if n * (1 + DRAWS) <= MOST_DOUBLE else np.float32)
    both[:, 0] = fit.slopes.without_followed(fit.white)
    drawn, quantised = _noise_draws(fit, records, rng)
    column = 1
    for block in drawn:
        left = fit.slopes.without_followed(block)
        if phi_estimated and not quantised:
            left = fit.slopes.without_followed(_whitened_again(left, joined, fit.phi))
        both[:, column : column + block.shape[1]] = left
        column += block.shape[1]
    return both, quantised


def _whitened_again(white: Floats, joined: Joined, phi: float) -> Floats:
    """Estimate the AR(1) coefficient of each column of (N, k) whitened residuals, and whiten the column with it.

    A whitened value is that of the frame less φ times that of the frame before, to within a factor.
    """
    coloured = joined.colour(white)
    # like the data's, these residuals have the means that the fit leaves
    change = ar1_coefficient([part - part.mean(axis=0) for part in joined.runs.split(coloured)]) - phi
    before = np.concatenate([np.zeros((1, white.shape[1])), coloured[:-1]])
    before[joined.runs.edges[:-1]] = 0.0
    return white - change / math.sqrt(1.0 - phi**2) * before


def in_blocks(both: Floats) -> Iterator[Floats]:
    """Yield a few columns at a time, in double precision."""
    width = _width(len(both))
    return (both[:, k : k + width].astype(float, copy=False) for k in range(0, both.shape[1], width))


def _width(frames: int) -> int:
    return max(1, AT_ONCE // frames) if frames * (1 + DRAWS) > MOST_DOUBLE else 1 + DRAWS


def _noise_draws(fit: Fit, records: Sequence[Record], rng: np.random.Generator) -> tuple[Iterator[Floats], bool]:
    """Return (N, DRAWS) whitened residuals, in blocks, that noise alone would leave, and whether of a quantiser.

    The scatter that the quantiser does not explain is white noise that acted before it. From a standard deviation of
    one step on, such noise makes the quantiser's error white as well.
    """
    n, width = len(fit.white), _width(len(fit.white))
    whites = (rng.standard_normal((n, min(width, DRAWS - k))) for k in range(0, DRAWS, width))
    grid = quantisation(records)
    before = math.sqrt(max(fit.rmse**2 - grid.sigma**2, 0.0)) if grid else math.inf
    if grid is None or before >= grid.step:
        return whites, False
    return _quantised(fit, records, grid, before, rng, whites), True


def _quantised(
    fit: Fit,
    records: Sequence[Record],
    grid: Grid,
    before: float,
    rng: np.random.Generator,
    whites: Iterator[Floats],
) -> Iterator[Floats]:
    """Yield rounding errors of motions with other parameters among those that the recordings leave possible."""
    joined, scale = join(records, fit.phi), None
    path = joined.angle - np.concatenate(fit.residuals)

    def rounded(paths: Floats) -> Floats:
        return np.concatenate(grid.rounded(list(joined.runs.split(paths))))

    def followed(values: Floats) -> Floats:
        return values - fit.slopes.without_followed(values)

    for white in whites:
        # the fit's parameters follow the rounding errors, which are less independent than white noise: the more so,
        # the longer the motion rests. Errors at another phase in each recording show by how much
        if scale is None:
            few = white[:, :PHASES]
            phases = rng.uniform(-0.5, 0.5, (len(records), few.shape[1]))
            phase = grid.step * phases[joined.runs.owner] + path[:, None]
            size = np.linalg.norm(followed(joined.whiten(rounded(phase + before * few) - phase)))
        other = rng.standard_normal(white.shape)
        if scale is None:
            scale = float(size / np.linalg.norm(followed(other[:, :PHASES])))
        exact = path[:, None] + scale * followed(other)
        yield joined.whiten(rounded(exact + before * white) - exact)
