"""χ² tests of an estimator's errors and innovations against the uncertainty that it states.

    NEES   eᵀP⁻¹e         of an error e whose stated covariance is P: χ² with as many degrees of freedom as e has
    NIS    yᵀS⁻¹y         of an innovation y whose stated variance is S: the same, and needs no truth

Bar-Shalom, Li and Kirubarajan, *Estimation with Applications to Tracking and Navigation*, 2001, sec. 5.4.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from anglecam.identification.ekf import EkfEstimate

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Consistency:
    """A mean of squared normalised errors and the range that is expected."""

    mean: float
    """Mean per degree of freedom. 1 is expected; a larger mean shows that the stated uncertainty is too small."""
    lower: float
    """The mean is lower by chance once in forty times."""
    upper: float
    """The mean is higher by chance once in forty times."""
    degrees_of_freedom: int
    """Degrees of freedom of the sum."""

    @property
    def holds(self) -> bool:
        """Whether the mean lies within its 95 % bounds."""
        return self.lower <= self.mean <= self.upper


def consistency(total: float, degrees_of_freedom: int) -> Consistency:
    """Compare a sum of squared normalised errors with χ².

    Parameters
    ----------
    total : float
        The sum.
    degrees_of_freedom : int
        Number of independent normal terms of variance 1 whose squares it should be the sum of.

    Returns
    -------
    Consistency
        Mean and bounds per degree of freedom.
    """
    lower, upper = special.chdtri(degrees_of_freedom, [0.975, 0.025]) / degrees_of_freedom
    return Consistency(total / degrees_of_freedom, float(lower), float(upper), degrees_of_freedom)


def error_consistency(errors: Floats, covariances: Floats) -> Consistency:
    """Test errors against their stated covariances (NEES); the truth must be known.

    Parameters
    ----------
    errors : (m, k) ndarray
        Estimate minus truth, of m independent trials.
    covariances : (m, k, k) ndarray
        Covariances that the estimator states; not singular.

    Returns
    -------
    Consistency
        With m·k degrees of freedom.
    """
    scale = np.sqrt(np.einsum("mii->mi", covariances))  # units differ by powers of ten
    unit, relative = errors / scale, covariances / (scale[:, :, None] * scale[:, None, :])
    return consistency(float(np.sum(unit * np.linalg.solve(relative, unit[:, :, None])[:, :, 0])), errors.size)


def innovation_consistency(estimate: EkfEstimate) -> Consistency:
    """Test a filter's innovations against their stated variances (NIS).

    Parameters
    ----------
    estimate : EkfEstimate
        Result of the filter; all its recordings are tested together.

    Returns
    -------
    Consistency
        Its degrees of freedom are the number of frames minus the unknowns that passes after the first fit to them, as
        the sum is then a minimised sum of squares.
    """
    normalised = np.concatenate(estimate.normalised)
    return consistency(float(normalised @ normalised), len(normalised) - estimate.fitted)


@dataclass(frozen=True)
class Whiteness:
    """Result of Ljung and Box's test."""

    statistic: float
    """Q = N(N + 2) Σ r_k²/(N − k), χ² with as many degrees of freedom as lags for white innovations."""
    lags: int
    """Largest distance, frames."""
    p_value: float
    """Probability of so large a statistic by chance."""
    correlation: Floats
    """(lags,) r_k, of innovations k frames apart."""


def innovation_whiteness(normalised: Sequence[Floats], *, lags: int = 12) -> Whiteness:
    """Test whether innovations are independent of earlier ones (Ljung and Box, Biometrika 65, 1978).

    Parameters
    ----------
    normalised : sequence of (n,) ndarray
        Normalised innovations of each recording; products are taken within recordings only.
    lags : int
        Largest distance, frames. Plant parameters fitted to the same data cost no degree of freedom; parameters of a
        noise model would.

    Returns
    -------
    Whiteness
        One test for all recordings.
    """
    count = sum(len(part) for part in normalised)
    energy = sum(float(part @ part) for part in normalised)
    correlation = np.array(
        [sum(float(part[lag:] @ part[:-lag]) for part in normalised) / energy for lag in range(1, lags + 1)]
    )
    statistic = float(count * (count + 2) * np.sum(correlation**2 / (count - np.arange(1, lags + 1))))
    return Whiteness(statistic, lags, float(special.chdtrc(lags, statistic)), correlation)
