"""Poles and zeros with their uncertainty: the parameters' covariance propagated to the roots of a polynomial.

    p(s) = Σ c_k·sᵏ = 0   ⇒   ∂s/∂c_k = −sᵏ/p′(s)

This is first order and holds for roots farther apart than their uncertainty. At a double root p′ = 0, and the roots
move by the square root of a change.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Roots:
    """Roots of a real polynomial."""

    value: NDArray[np.complex128]
    """(n,) in the order of the real part, the upper root of a pair first, 1/s."""
    covariance: Floats
    """(n, 2, 2) covariance of each root's real and imaginary part, 1/s²; zero for the imaginary part of a real root."""

    @property
    def sigma(self) -> Floats:
        """(n, 2) standard uncertainties of real and imaginary part, 1/s."""
        return np.sqrt(np.einsum("nii->ni", self.covariance))


def roots_with_sigma(coefficients: Floats, covariance: Floats) -> Roots:
    """Return a polynomial's roots and their uncertainty.

    Parameters
    ----------
    coefficients : (n + 1,) ndarray
        Highest power first, as in `numpy.roots`.
    covariance : (n + 1, n + 1) ndarray
        Covariance of the coefficients; zeros for a fixed one, for example the leading 1 of a denominator.

    Returns
    -------
    Roots
        All n roots.
    """
    value = np.roots(coefficients).astype(complex)
    value = value[np.lexsort((-value.imag, value.real.round(9)))]
    powers = value[:, None] ** np.arange(len(coefficients) - 1, -1, -1)
    slope = -powers / np.polyval(np.polyder(coefficients), value)[:, None]
    parts = np.stack([slope.real, slope.imag], axis=1)
    return Roots(value, np.einsum("nik,kl,njl->nij", parts, covariance, parts))


def poles_and_zeros(parameters: Floats, covariance: Floats) -> tuple[Roots, Roots]:
    """Return poles and zeros of `anglecam.models.third_order.ThirdOrder`, the form of SYS2, Eq. (36).

    Parameters
    ----------
    parameters : (6,) ndarray
        d2, d1, d0, n2, n1, n0 in SI.
    covariance : (6, 6) ndarray
        SI.

    Returns
    -------
    poles, zeros : Roots
        Three and two.
    """
    denominator = np.zeros((4, 4))
    denominator[1:, 1:] = covariance[:3, :3]
    return (
        roots_with_sigma(np.array([1.0, *parameters[:3]]), denominator),
        roots_with_sigma(parameters[3:], covariance[3:, 3:]),
    )
