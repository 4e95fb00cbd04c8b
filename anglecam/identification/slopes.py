"""Derivatives of the predictions of several recordings, and the space of the changes that a fit can follow.

A nuisance parameter changes the prediction of one recording only, so the Jacobian of all unknowns is block arrowhead:
p full columns, and k columns that are nonzero in the rows of one recording at a time. It is never written out. Each
recording's k columns are made orthonormal by themselves, and the shared columns are projected onto their orthogonal
complement. Memory and time then grow with the number of frames, however many recordings share them. The least-squares
solution, its residual and the covariance of the shared parameters are those of the whole Jacobian (the theorem of
Frisch and Waugh, Econometrica 1, 1933; Golub and Pereyra, Inverse Problems 19, 2003, R1).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numba import njit
from numpy.typing import NDArray

from anglecam.data.typing import Floats

_DEPENDENT = 1e-6
"""Remaining norm, as a share of a column's norm, below which the column depends on others. The difference quotients of
a plant with kinks are no more accurate."""


@dataclass(frozen=True)
class Slopes:
    """Derivatives of the whitened predictions of R recordings with N frames in all."""

    shared: Floats = field(repr=False)
    """(N, p) with respect to the shared parameters."""
    own: Floats = field(repr=False)
    """(N, k) with respect to the nuisance parameters of the recording that each row belongs to; zeros for a zero that
    is declared."""
    edges: NDArray[np.int64] = field(repr=False)
    """(R + 1,) where each recording begins in the rows, and the end."""

    @property
    def rank(self) -> int:
        """Number of independent changes that shared and nuisance parameters make."""
        return self._basis.shape[1] + self._own_rank

    @cached_property
    def projected(self) -> Floats:
        """(N, p) ``shared``, less the part that the nuisance parameters can follow; zeros where nothing is left."""
        left = self.without_own(self.shared)
        whole, rest = (np.linalg.norm(columns, axis=0) for columns in (self.shared, left))
        return np.where(rest > _DEPENDENT * whole, left, 0.0)

    def own_change(self, values: Floats) -> Floats:
        """Return the (R, k) change of the nuisance parameters that follows (N,) whitened values best."""
        basis, factor = self._own
        return _solve(basis, factor, self.edges, np.ascontiguousarray(values))

    def without_own(self, values: Floats) -> Floats:
        """Return (N,) or (N, m) values less the part that the nuisance parameters can follow."""
        columns = values[:, None] if values.ndim == 1 else values
        left = _remove(self._own[0], self.edges, np.ascontiguousarray(columns, dtype=float))
        return left[:, 0] if values.ndim == 1 else left

    def without_followed(self, values: Floats) -> Floats:
        """Return (N,) or (N, m) values less the part that shared and nuisance parameters can follow."""
        left = self.without_own(values)
        return np.asarray(left - self._basis @ (self._basis.T @ left))

    @cached_property
    def _own(self) -> tuple[Floats, Floats]:
        return _orthonormal(np.ascontiguousarray(self.own), self.edges)

    @property
    def _own_rank(self) -> int:
        return int(np.count_nonzero(np.diagonal(self._own[1], axis1=1, axis2=2)))

    @cached_property
    def _basis(self) -> Floats:
        """(N, r) orthonormal basis of the columns of ``projected``."""
        used = np.linalg.norm(self.projected, axis=0) > 0.0  # the column of a parameter at its bound may be zero
        basis, _ = np.linalg.qr(self.projected[:, used])
        return basis


@njit("(float64[:, ::1], int64[::1])", nogil=True, cache=True)
def _orthonormal(own: Floats, edges: NDArray[np.int64]) -> tuple[Floats, Floats]:
    """Return each recording's columns made orthonormal, (N, k), and the triangular factors, (R, k, k).

    Gram-Schmidt, each column twice, which leaves it orthogonal to rounding. A dependent column becomes zero.
    """
    count, runs = own.shape[1], len(edges) - 1
    basis, factor = own.copy(), np.zeros((runs, count, count))
    for run in range(runs):
        for j in range(count):
            column = basis[edges[run] : edges[run + 1], j]
            whole = np.sqrt(np.sum(column * column))
            for _ in range(2):
                for i in range(j):
                    before = basis[edges[run] : edges[run + 1], i]
                    along = np.sum(before * column)
                    factor[run, i, j] += along
                    column -= along * before
            left = np.sqrt(np.sum(column * column))
            if left > _DEPENDENT * whole:
                factor[run, j, j] = left
                column /= left
            else:
                column[:] = 0.0
    return basis, factor


@njit("(float64[:, ::1], float64[:, :, ::1], int64[::1], float64[::1])", nogil=True, cache=True)
def _solve(basis: Floats, factor: Floats, edges: NDArray[np.int64], values: Floats) -> Floats:
    """Return each recording's coefficients of its own columns by least squares; zero for a dependent column."""
    runs, count = factor.shape[0], factor.shape[1]
    change = np.zeros((runs, count))
    for run in range(runs):
        part = values[edges[run] : edges[run + 1]]
        for j in range(count - 1, -1, -1):
            if factor[run, j, j] > 0.0:
                along = np.sum(basis[edges[run] : edges[run + 1], j] * part)
                for i in range(j + 1, count):
                    along -= factor[run, j, i] * change[run, i]
                change[run, j] = along / factor[run, j, j]
    return change


@njit("(float64[:, ::1], int64[::1], float64[:, ::1])", nogil=True, cache=True)
def _remove(basis: Floats, edges: NDArray[np.int64], values: Floats) -> Floats:
    """Return (N, m) values less their projection onto each recording's orthonormal columns."""
    left, width = values.copy(), values.shape[1]
    along = np.empty(width)
    for run in range(len(edges) - 1):
        for j in range(basis.shape[1]):
            along[:] = 0.0
            for row in range(edges[run], edges[run + 1]):
                for m in range(width):
                    along[m] += basis[row, j] * left[row, m]
            for row in range(edges[run], edges[run + 1]):
                for m in range(width):
                    left[row, m] -= basis[row, j] * along[m]
    return left
