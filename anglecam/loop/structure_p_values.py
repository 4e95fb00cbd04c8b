"""p-values of the residual test, each from the share of the residual's energy that a test's directions hold.

A share of energy needs no size of the noise. For white noise in n dimensions the share in k of them has the
distribution Beta(k/2, (n − k)/2). Every function takes the data's residual and all draws of the noise at once, as the
columns of one array, and returns a value for each.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from scipy import special

from anglecam.data.record import Record
from anglecam.data.typing import Floats
from anglecam.identification.joined import RUNAWAY
from anglecam.identification.slopes import Slopes
from anglecam.loop.noise_draws import in_blocks
from anglecam.loop.screen import Direction

LEAST_P = 1e-300
"""Smaller p-values count as this one, so that they have a logarithm."""
LAGS = 15
"""Lags of the autocorrelation test, in frames."""


def p_of_directions(each: Sequence[Direction], residuals: Floats, energy: Floats, free: int) -> tuple[Floats, Floats]:
    """Return the smallest p-value and the largest log-likelihood gain over directions, for each residual (column).

    For white noise in n dimensions the share of the energy in one of them has the distribution Beta(1/2, (n − 1)/2).
    """
    along = _times(np.stack([direction.change / direction.size for direction in each]), residuals)
    share = np.minimum(along**2 / energy, 1.0)
    if not each[0].one_sided:
        largest = share.max(axis=0)
        return special.betaincc(0.5, 0.5 * (free - 1), largest), gain_of_share(largest, free)
    largest = np.where(along > 0.0, share, -share).max(axis=0)
    p = 0.5 * special.betaincc(0.5, 0.5 * (free - 1), np.abs(largest))
    return np.where(largest > 0.0, p, 1.0 - p), gain_of_share(np.maximum(largest, 0.0), free)


def p_of_space(basis: Floats, slopes: Slopes, residuals: Floats, energy: Floats, free: int) -> tuple[Floats, Floats]:
    """Return p-value and log-likelihood gain of a space for each residual (column).

    They follow from the share of the residual's energy in the part of the space that the fit cannot follow. For white
    noise in n dimensions the share in k of them has the distribution Beta(k/2, (n − k)/2). Columns in which an unstable
    plant runs away are left out.
    """
    basis = basis[:, np.max(np.abs(basis), axis=0) < RUNAWAY]
    u, size, _ = np.linalg.svd(slopes.without_followed(basis), full_matrices=False)
    u = u[:, size > 1e-6 * max(float(np.linalg.norm(basis)), 1e-300)]
    k = u.shape[1]
    if k == 0:
        return np.ones(residuals.shape[1]), np.zeros(residuals.shape[1])
    share = np.minimum(np.sum(_times(u.T, residuals) ** 2, axis=0) / energy, 1.0)
    return special.betaincc(0.5 * k, 0.5 * (free - k), share), gain_of_share(share, free)


def p_of_autocorrelation(residuals: Floats, energy: Floats, records: Sequence[Record]) -> Floats:
    """Return the p-value of the autocorrelations within recordings (Ljung and Box, Biometrika 65, 1978), (columns,)."""
    edges = np.cumsum([0, *(len(r.time) for r in records)])
    n = len(residuals)
    total = np.zeros(residuals.shape[1])
    for lag in range(1, LAGS + 1):
        products = []
        for block in in_blocks(residuals):
            parts = [block[start:stop] for start, stop in pairwise(edges)]
            products.append(sum(np.sum(part[lag:] * part[:-lag], axis=0) for part in parts))
        total += n * (n + 2) / (n - lag) * (np.concatenate(products) / energy) ** 2
    return np.asarray(special.chdtrc(LAGS, total))


def gain_of_share(share: Floats, free: int) -> Floats:
    """Return the log-likelihood gain if a share of a residual's energy is explained."""
    return np.asarray(-0.5 * free * np.log(np.maximum(1.0 - share, 1e-6)))


def _times(rows: Floats, residuals: Floats) -> Floats:
    """Return a product with residuals in their precision, without a copy of them in another."""
    return np.asarray(rows.astype(residuals.dtype) @ residuals, dtype=float)


def competing_directions(smallest: Floats) -> float:
    """Return of how many independent p-values these are the smallest, from their median; at least 1."""
    return max(1.0, math.log(0.5) / math.log1p(-min(max(float(np.median(smallest)), 1e-12), 0.5)))


def sidak(p: Floats | float, count: float) -> Floats:
    """Return the probability that the smallest of several independent p-values is at most p, 1 − (1 − p)^count."""
    with np.errstate(divide="ignore"):
        return np.asarray(-np.expm1(count * np.log1p(-np.minimum(p, 1.0))))


def exponential_scale(p: Floats) -> tuple[float, float]:
    """Return shape and scale of the gamma distribution with mean and variance of −log p; (1, 1) for uniform p."""
    size = -np.log(np.maximum(p, LEAST_P))
    mean, variance = float(np.mean(size)), float(np.var(size))
    return (mean**2 / variance, variance / mean) if mean > 0.0 and variance > 0.0 else (1.0, 1.0)


def as_uniform(p: Floats, shape_and_scale: tuple[float, float]) -> Floats:
    """Return p-values that are uniform where −log p has the gamma distribution of `exponential_scale`."""
    shape, scale = shape_and_scale
    return p if shape == scale == 1.0 else np.asarray(special.gammaincc(shape, -np.log(np.maximum(p, LEAST_P)) / scale))


def before_uniform(p: float, shape_and_scale: tuple[float, float]) -> float:
    """Return the p-value that `as_uniform` turns into ``p``."""
    shape, scale = shape_and_scale
    return float(np.exp(-scale * special.gammainccinv(shape, p)))
