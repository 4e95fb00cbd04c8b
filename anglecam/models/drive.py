"""The drive signal v between two stops: the command on a straight line, behind a first-order lag τ·v̇ = u − v.

A *segment* is an array of three numbers: the level of u at the last stop (rad), its slope (rad/s), and the lag's
transient there, v minus the solution that it settles to (rad).
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit
def line_at(knots, k, now):  # type: ignore[no-untyped-def]  # compiled
    """Return level and slope of the command at an instant after knot ``k``; -1 is before the first knot."""
    if k < 0:
        return knots[1, 0], 0.0
    return knots[1, k] + knots[2, k] * (now - knots[0, k]), knots[2, k]


@njit
def drive_at(after, segment, lag):  # type: ignore[no-untyped-def]  # compiled
    """Return v at ``after`` seconds after the last stop, in closed form."""
    if lag == 0.0:
        return segment[0] + segment[1] * after
    return segment[0] + segment[1] * (after - lag) + segment[2] * np.exp(-after / lag)
