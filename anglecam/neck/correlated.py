"""Quantities that are uncertain together, and what follows from them.

A relation y = f(x) carries the covariance of x to y by its slope, Σ_y = D·Σ_x·Dᵀ (JCGM 102, 6.2.1.3), and what follows
stays correlated with what it follows from: a second relation that uses both loses nothing. The slope is exact, by a
step along the imaginary axis: ∂f/∂x = Im f(x + i·s)/s with no difference to cancel (Squire & Trapp 1998).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from anglecam.data.typing import Floats

_STEP = 1e-30


@dataclass(frozen=True)
class UncertainValue:
    """A number and its standard uncertainty, in one unit."""

    value: float
    sigma: float = 0.0
    """0 where it is taken as exact."""


@dataclass(frozen=True)
class CorrelatedQuantities:
    """Named quantities with one covariance; each in its own SI unit."""

    names: tuple[str, ...]
    values: Floats
    """(n,)."""
    covariance: Floats
    """(n, n)."""

    def __getitem__(self, name: str) -> UncertainValue:
        i = self.names.index(name)
        return UncertainValue(float(self.values[i]), float(np.sqrt(max(self.covariance[i, i], 0.0))))

    def __contains__(self, name: object) -> bool:
        return name in self.names

    def __add__(self, other: CorrelatedQuantities) -> CorrelatedQuantities:
        """Put beside each other what is known independently."""
        shared = set(self.names) & set(other.names)
        if shared:
            raise ValueError(f"{', '.join(sorted(shared))} stands on both sides")
        n = len(self.names)
        both = np.zeros((n + len(other.names),) * 2)
        both[:n, :n], both[n:, n:] = self.covariance, other.covariance
        return CorrelatedQuantities(self.names + other.names, np.concatenate([self.values, other.values]), both)

    def replaced(self, **quantities: UncertainValue) -> CorrelatedQuantities:
        """Return the same with some quantities known otherwise, independently of the rest.

        Raises
        ------
        ValueError
            For a name that is not among them.
        """
        unknown = set(quantities) - set(self.names)
        if unknown:
            raise ValueError(f"no quantity {', '.join(sorted(unknown))} among {', '.join(self.names)}")
        values, covariance = self.values.copy(), self.covariance.copy()
        for name, quantity in quantities.items():
            i = self.names.index(name)
            values[i] = quantity.value
            covariance[i, :] = covariance[:, i] = 0.0
            covariance[i, i] = quantity.sigma**2
        return CorrelatedQuantities(self.names, values, covariance)

    def derived(self, relation: Callable[[Mapping[str, Any]], Mapping[str, Any]]) -> CorrelatedQuantities:
        """Add what follows from the quantities.

        Parameters
        ----------
        relation : callable
            From a mapping of names to numbers to another one; built of analytic operations only (no ``abs``, no
            comparison), because it is called with complex numbers.

        Returns
        -------
        CorrelatedQuantities
            The quantities, then those that follow.
        """
        told = relation(dict(zip(self.names, self.values.tolist(), strict=True)))
        slopes = np.empty((len(told), len(self.names)))
        for i in range(len(self.names)):
            moved = self.values.astype(complex)
            moved[i] += 1j * _STEP
            answer = relation(dict(zip(self.names, moved.tolist(), strict=True)))
            slopes[:, i] = [np.imag(answer[name]) / _STEP for name in told]
        carried = np.vstack([np.eye(len(self.names)), slopes])
        return CorrelatedQuantities(
            self.names + tuple(told),
            np.concatenate([self.values, np.array([float(np.real(v)) for v in told.values()])]),
            carried @ self.covariance @ carried.T,
        )


def correlated(values: Mapping[str, float], uncertainty: ArrayLike) -> CorrelatedQuantities:
    """Put quantities together with what is known of their errors.

    Parameters
    ----------
    values : mapping
        Names and values, SI.
    uncertainty : (n,) or (n, n) array_like
        Standard uncertainties of independent values, or their covariance.

    Returns
    -------
    CorrelatedQuantities
        In the mapping's order.

    Raises
    ------
    ValueError
        If a value is not finite, or the covariance is of another size, not symmetric or not positive semidefinite.
    """
    given = np.asarray(uncertainty, dtype=float)
    n = len(values)
    if given.shape not in ((n,), (n, n)) or not np.isfinite(given).all():
        raise ValueError(
            f"the uncertainty of {n} quantities is {n} finite numbers or {n}×{n}, not of shape {given.shape}"
        )
    centre = np.array(list(values.values()), dtype=float)
    if not np.isfinite(centre).all():
        raise ValueError(f"not finite: {', '.join(k for k, v in values.items() if not np.isfinite(v))}")
    if given.ndim == 1 and (given < 0.0).any():
        raise ValueError("a standard uncertainty is negative")
    covariance = np.diag(given**2) if given.ndim == 1 else given
    size = np.sqrt(np.abs(np.diag(covariance)))
    scaled = covariance / np.outer(np.where(size > 0, size, 1.0), np.where(size > 0, size, 1.0))
    if not np.allclose(scaled, scaled.T, atol=1e-9) or np.linalg.eigvalsh(scaled).min() < -1e-9:
        raise ValueError(f"the covariance of {', '.join(values)} is not symmetric and positive semidefinite")
    return CorrelatedQuantities(tuple(values), centre, covariance)
