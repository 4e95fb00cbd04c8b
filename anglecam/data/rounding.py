"""A value and its standard uncertainty as text, rounded alike wherever both are shown."""

from __future__ import annotations

import numpy as np

UNDETERMINED = "not determined by these recordings, or at a bound"
"""Why a fit gives a parameter no uncertainty."""


def with_uncertainty(value: float, sigma: float, unit: str = "") -> str:
    """Return a value, rounded to the second digit of its standard uncertainty, with the uncertainty and ``unit``.

    Examples
    --------
    >>> with_uncertainty(12.3456, 0.078, " 1/s")
    '12.346 ± 0.078 1/s'
    """
    if not np.isfinite(value):
        return "none"
    if not 0.0 < sigma < np.inf:
        return f"{value:.4g}{unit} (no uncertainty: {UNDETERMINED})"
    digits = int(np.clip(1 - np.floor(np.log10(sigma)), 0, 8))
    return f"{value:.{digits}f} ± {sigma:.{digits}f}{unit}"
