"""Quantities with a common covariance, and the propagation of that covariance to derived quantities.

A relation y = f(x) propagates the covariance of x to y through its Jacobian, Σ_y = D·Σ_x·Dᵀ (JCGM 102, 6.2.1.3).
Derived quantities stay correlated with those they derive from, so a second relation may use both. The Jacobian is
exact, by a complex step: ∂f/∂x = Im f(x + i·s)/s, without the cancellation of a difference (Squire & Trapp 1998).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from anglecam.data.typing import Floats

_STEP = 1e-30
"""s of the complex step: so small that its square vanishes beside 1."""


@dataclass(frozen=True)
class UncertainValue:
    """A number and its standard uncertainty, in the same unit."""

    value: float
    sigma: float = 0.0
    """0 for a value that counts as exact."""


@dataclass(frozen=True)
class CorrelatedQuantities:
    """Named quantities with a common covariance, each in SI."""

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
        """Join two sets of quantities that are independent of each other."""
        shared = set(self.names) & set(other.names)
        if shared:
            raise ValueError(f"{', '.join(sorted(shared))} is in both sets")
        n = len(self.names)
        both = np.zeros((n + len(other.names),) * 2)
        both[:n, :n], both[n:, n:] = self.covariance, other.covariance
        return CorrelatedQuantities(self.names + other.names, np.concatenate([self.values, other.values]), both)

    def replaced(self, **quantities: UncertainValue) -> CorrelatedQuantities:
        """Return a copy in which some quantities have other values, independent of the rest.

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
        """Return the quantities with derived ones appended.

        Parameters
        ----------
        relation : callable
            From a mapping of names to numbers to a mapping of derived ones; analytic operations only (no ``abs``, no
            comparison), because it is called with complex numbers.

        Returns
        -------
        CorrelatedQuantities
            The quantities, then the derived ones.
        """
        derived = relation(dict(zip(self.names, self.values.tolist(), strict=True)))
        slopes = np.empty((len(derived), len(self.names)))
        for i in range(len(self.names)):
            shifted = self.values.astype(complex)
            shifted[i] += 1j * _STEP
            complex_result = relation(dict(zip(self.names, shifted.tolist(), strict=True)))
            slopes[:, i] = [np.imag(complex_result[name]) / _STEP for name in derived]
        jacobian = np.vstack([np.eye(len(self.names)), slopes])
        return CorrelatedQuantities(
            self.names + tuple(derived),
            np.concatenate([self.values, np.array([float(np.real(v)) for v in derived.values()])]),
            jacobian @ self.covariance @ jacobian.T,
        )


def correlated(values: Mapping[str, float], uncertainty: ArrayLike) -> CorrelatedQuantities:
    """Return quantities with their standard uncertainties or covariance.

    Parameters
    ----------
    values : mapping
        Names and values, SI.
    uncertainty : (n,) or (n, n) array_like
        Standard uncertainties of independent values, or their covariance.

    Returns
    -------
    CorrelatedQuantities
        In the order of the mapping.

    Raises
    ------
    ValueError
        If a value is not finite, or the covariance has another size, is not symmetric or is not positive semidefinite.
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
