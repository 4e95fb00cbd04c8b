"""A commanded angle as a piecewise linear function of time, and its first-order lag in closed form."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class PiecewiseLinear:
    """u = level + slope·(t − knot) from each knot to the next; 0 before the first knot."""

    knots: Floats
    """s, ascending."""
    levels: Floats
    """rad."""
    slopes: Floats
    """rad/s."""

    def lagged(self, lag: float, begin: float, v: float) -> Callable[[float], float]:
        """Return v(t) of τ·v̇ = u − v from `begin` to the next knot.

        Parameters
        ----------
        lag : float
            τ, s; with 0 the result is u itself.
        begin : float
            s.
        v : float
            Value at `begin`, rad.

        Returns
        -------
        callable
            t, s → v, rad.
        """
        k = int(np.searchsorted(self.knots, begin, side="right")) - 1
        if k >= 0:
            knot, level, slope = float(self.knots[k]), float(self.levels[k]), float(self.slopes[k])
        else:
            knot, level, slope = begin, 0.0, 0.0
        if lag == 0.0:
            return lambda t: level + slope * (t - knot)
        behind = level + slope * (begin - knot) - slope * lag
        return lambda t: behind + slope * (t - begin) + (v - behind) * math.exp(-(t - begin) / lag)
