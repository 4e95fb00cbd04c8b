"""How much better one fit is than another, and how far their predictions are apart."""

from __future__ import annotations

import math

import numpy as np

from anglecam.identification.fit import Fit


def log_likelihood_gain(before: float, after: float, n: int) -> float:
    """Return the log-likelihood gain of n whitened residuals whose sum of squares, rad², falls from before to after."""
    if not math.isfinite(after):
        return -math.inf
    offset = n * 1e-9**2  # rad²; avoids a division by zero for data without noise
    return 0.5 * n * math.log((before + offset) / (after + offset))


def rms_difference(one: Fit, other: Fit) -> float:
    """Return the RMS difference, rad, between the predictions of two fits to the same recordings."""
    return float(np.sqrt(np.mean((np.concatenate(one.residuals) - np.concatenate(other.residuals)) ** 2)))
