"""Smoother of a motion whose derivative of order p is white noise, measured at any times.

    state x = (θ, θ̇, …) of p entries:   xₖ₊₁ = F·xₖ + w,   w ~ N(0, Q),   yₖ = θₖ + v,   v ~ N(0, rₖ)

    Fᵢⱼ = Δʲ⁻ⁱ/(j − i)!      Qᵢⱼ = q·Δᵐ/(m·(p − 1 − i)!·(p − 1 − j)!)  with  m = 2p − 1 − i − j

The mean of θ given all frames is the smoothing spline of degree 2p − 1 (Wahba, J. R. Stat. Soc. B 40, 1978). Two passes
meet in each frame (Fraser and Potter, IEEE Trans. Autom. Control 14, 1969). The forward pass gives the state x and its
covariance SSᵀ from the frames up to this one, the backward pass the information U·x = z + N(0, 1) of the later ones:

    smoothed     P = S·M⁻¹·Sᵀ    x ← x + S·M⁻¹·(US)ᵀ·(z − Ux)    with  M = 1 + (US)ᵀ·US
    back by Δ    U ← Z⁻¹·U·F     z ← Z⁻¹·z                       with  ZZᵀ = 1 + U·Q·Uᵀ

Both passes carry roots, never products (Bierman, Factorization Methods for Discrete Sequential Estimation, 1977): the
start is vague, and a variance that falls by twenty orders of magnitude in the first frames must stay positive.
"""

from __future__ import annotations

from functools import cache
from math import factorial

import numpy as np
from numba import njit, types

from anglecam.data.typing import Floats
from anglecam.models.array_types import MATRIX, READ_MATRIX, READ_VECTOR

_ROOTS = types.Array(types.float64, 3, "C")


def smooth(time: Floats, value: Floats, variance: Floats, spread: Floats, intensity: Floats) -> tuple[Floats, Floats]:
    """Return the state of every frame given all frames.

    Parameters
    ----------
    time, value, variance : ndarray
        (n,) increasing times, measured values and variances r, in units that make them about 1.
    spread : ndarray
        (p,) standard deviations of the first state about (``value[0]``, 0, …); large, where nothing is known.
    intensity : ndarray
        (n,) q of the interval before each frame, or one for all.

    Returns
    -------
    mean, variance : ndarray
        (n, p) of θ, θ̇, … each.

    Examples
    --------
    Three exact values of a parabola give its derivatives.

    >>> time = np.array([0.0, 1.0, 3.0])
    >>> mean, _ = smooth(time, time**2, np.full(3, 1e-12), np.full(3, 1e3), np.array(1e-12))
    >>> np.round(mean[2], 6)
    array([9., 6., 2.])
    """
    n, p = len(time), len(spread)
    mean, variances, roots = np.empty((n, p)), np.empty((n, p)), np.empty((n, p, p))
    density = np.sqrt(np.broadcast_to(intensity, n))
    _forward(time, value, variance, spread, density, _unit_root(p), mean, roots)
    _backward(time, value, variance, density, _unit_root(p), mean, roots, variances)
    return mean, variances


@cache
def _unit_root(p: int) -> Floats:
    """Return the Cholesky root of Q for q = Δ = 1."""
    i = np.arange(p)
    below = np.array([factorial(p - 1 - k) for k in i], float)
    return np.asarray(np.linalg.cholesky(1.0 / ((2 * p - 1 - i[:, None] - i) * np.outer(below, below))), float)


@njit(types.void(types.float64, types.float64, READ_MATRIX, MATRIX, MATRIX), nogil=True, cache=True)
def _step(interval: float, density: float, unit_root: Floats, transition: Floats, root: Floats) -> None:
    """Write F and the root of Q of an interval into two (p, p) arrays; ``density`` is the root of q."""
    p = len(transition)
    for i in range(p):
        term = 1.0
        for j in range(i, p):
            transition[i, j] = term
            term *= interval / (j - i + 1)
        size = density * interval ** (p - 0.5 - i)
        for j in range(i + 1):
            root[i, j] = size * unit_root[i, j]


@njit(types.void(MATRIX, types.int64), nogil=True, cache=True)
def _triangulate(array: Floats, columns: int) -> None:
    """Make the first ``columns`` of an (m, k) array upper triangular by Householder's reflections, in place."""
    m, k = array.shape
    for c in range(min(columns, m)):
        norm = 0.0
        for i in range(c, m):
            norm += array[i, c] ** 2
        norm = np.sqrt(norm)
        if norm == 0.0:
            continue
        if array[c, c] > 0.0:
            norm = -norm
        head = array[c, c] - norm
        for j in range(c + 1, k):
            along = head * array[c, j]
            for i in range(c + 1, m):
                along += array[i, c] * array[i, j]
            along /= -norm * head
            array[c, j] -= along * head
            for i in range(c + 1, m):
                array[i, j] -= along * array[i, c]
        array[c, c] = norm
        for i in range(c + 1, m):
            array[i, c] = 0.0


@njit(types.void(MATRIX, MATRIX, MATRIX), nogil=True, cache=True)
def _solve_one_plus(root: Floats, right: Floats, stacked: Floats) -> None:
    """Replace ``right`` (p, k) by Z⁻¹·right, where ZZᵀ = 1 + root·rootᵀ; ``stacked`` is (2p, p) working space."""
    p = len(root)
    stacked[:p] = root.T
    stacked[p:] = np.eye(p)
    _triangulate(stacked, p)
    for i in range(p):
        for c in range(right.shape[1]):
            total = right[i, c]
            for m in range(i):
                total -= stacked[m, i] * right[m, c]
            right[i, c] = total / stacked[i, i]


@njit(
    types.void(READ_VECTOR, READ_VECTOR, READ_VECTOR, READ_VECTOR, READ_VECTOR, READ_MATRIX, MATRIX, _ROOTS),
    nogil=True,
    cache=True,
)
def _forward(
    time: Floats,
    value: Floats,
    variance: Floats,
    spread: Floats,
    density: Floats,
    unit_root: Floats,
    mean: Floats,
    roots: Floats,
) -> None:
    """Write (n, p) states given the frames up to each one, and the (n, p, p) roots S of their covariances.

    (n,) ``density`` is √q, ``unit_root`` the root of Q for q = Δ = 1.
    """
    n, p = mean.shape
    x, S = np.zeros(p), np.diag(spread)
    x[0] = value[0]
    F, B = np.zeros((p, p)), np.zeros((p, p))
    stacked = np.empty((2 * p, p))
    for k in range(n):
        if k > 0:
            _step(time[k] - time[k - 1], density[k], unit_root, F, B)
            x = F @ x
            stacked[:p] = (F @ S).T
            stacked[p:] = B.T
            _triangulate(stacked, p)
            S = np.ascontiguousarray(stacked[:p].T)
        # S is triangular, so only its first column is measured; the update shrinks it and subtracts nothing
        predicted = S[0, 0] ** 2 + variance[k]
        x = x + S[:, 0] * (S[0, 0] / predicted * (value[k] - x[0]))
        S[:, 0] *= np.sqrt(variance[k] / predicted)
        mean[k], roots[k] = x, S


@njit(
    types.void(READ_VECTOR, READ_VECTOR, READ_VECTOR, READ_VECTOR, READ_MATRIX, MATRIX, _ROOTS, MATRIX),
    nogil=True,
    cache=True,
)
def _backward(
    time: Floats,
    value: Floats,
    variance: Floats,
    density: Floats,
    unit_root: Floats,
    mean: Floats,
    roots: Floats,
    variances: Floats,
) -> None:
    """Turn the states that `_forward` wrote into those given all frames, and write their (n, p) variances."""
    n, p = mean.shape
    F, B = np.zeros((p, p)), np.zeros((p, p))
    stacked = np.empty((2 * p, p))
    known = np.zeros((p + 1, p + 1))  # the rows of U and z, and one row for a measurement
    right = np.empty((p, p + 1))
    for k in range(n - 1, -1, -1):
        U, z = known[:p, :p].copy(), known[:p, p].copy()
        across = np.ascontiguousarray((U @ roots[k]).T)
        right[:, :p] = roots[k].T
        right[:, p] = across @ (z - U @ mean[k])
        _solve_one_plus(across, right, stacked)
        for i in range(p):
            variances[k, i] = 0.0
            for m in range(p):
                variances[k, i] += right[m, i] ** 2
                mean[k, i] += right[m, i] * right[m, p]
        if k > 0:
            weight = 1.0 / np.sqrt(variance[k])
            known[p, :] = 0.0
            known[p, 0], known[p, p] = weight, weight * value[k]
            _triangulate(known, p)
            _step(time[k] - time[k - 1], density[k], unit_root, F, B)
            U = known[:p, :p].copy()
            right[:, :p] = U @ F
            right[:, p] = known[:p, p]
            _solve_one_plus(U @ B, right, stacked)
            known[:p] = right
