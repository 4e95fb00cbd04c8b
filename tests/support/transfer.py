"""The exact response of a transfer function to a piecewise constant command, by superposition of step responses."""

from __future__ import annotations

import numpy as np
from scipy.signal import residue

SYS2_NUMERATOR = 47.3859 * np.array([1.0, 56.8, 980.1])
SYS2_DENOMINATOR = np.polymul([1.0, 13.22], [1.0, 12.29, 149.0])
SYS2 = np.array([*SYS2_DENOMINATOR[1:], *SYS2_NUMERATOR])
"""Eq. (36) in the parameters of `anglecam.models.third_order.ThirdOrder`."""


def respond(
    numerator: np.ndarray, denominator: np.ndarray, times: np.ndarray, switches: np.ndarray, levels: np.ndarray
) -> np.ndarray:
    """Return the (n,) response from rest at zero: H(s)/s = Σ rᵢ/(s − pᵢ), so the step response is Σ rᵢ·exp(pᵢt)."""
    residues, poles, _ = residue(numerator, np.polymul(denominator, [1.0, 0.0]))
    since = np.maximum(times[:, None] - switches, 0.0)
    steps = np.exp(since[:, :, None] * poles) @ residues
    return (np.where(times[:, None] >= switches, steps.real, 0.0)) @ np.diff(levels, prepend=0.0)
