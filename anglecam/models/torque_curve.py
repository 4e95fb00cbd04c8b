"""A torque of free form: a smooth function of one or two quantities, as cubic B-splines with evenly spaced knots.

    τ(x) = Σ γᵢ·Bᵢ(x)          τ(x, y) = Σ γᵢⱼ·Bᵢ(x)·Bⱼ(y)

x and y are two of: angle, velocity, command at the drive, phase within the period of a periodic command, and time.
Beyond its knots a curve keeps its last value. De Boor, A Practical Guide to Splines, 1978, ch. IX.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from anglecam.data.typing import Floats
from anglecam.effects import ports

QUANTITIES = ("angle", "velocity", "command", "phase", "time")
"""What a curve can be over; rad, rad/s, rad, share of the period from 0 to 1, s."""
ANGLE, VELOCITY, COMMAND, PHASE = range(4)
ORDER = 4
"""Splines that are not zero at a point: they are cubic."""
NO_AXIS = (0.0, 0.0, 1.0, 1.0)
"""Header of the second axis of a curve over one quantity."""
HEADER = 10
"""Numbers before the coefficients: for each axis the quantity, the first knot, the distance of the knots and the number
of splines; then the period of the command, 0 without one, and an instant at which a period begins, s."""


@dataclass(frozen=True)
class Axis:
    """The knots along one quantity."""

    quantity: str
    """One of `QUANTITIES`."""
    low: float
    """First knot, in the quantity's unit."""
    high: float
    """Last knot."""
    count: int
    """Number of splines, at least `ORDER`."""

    @property
    def step(self) -> float:
        """Distance from knot to knot."""
        return (self.high - self.low) / (self.count - ORDER + 1)

    @property
    def header(self) -> tuple[float, float, float, float]:
        """Quantity, first knot, distance of the knots and number of splines."""
        return float(QUANTITIES.index(self.quantity)), self.low, self.step, float(self.count)

    def splines(self, x: Floats) -> Floats:
        """Return the (n, count) values of the splines at ``x``, (n,)."""
        place = np.clip((x - self.low) / self.step, 0.0, self.count - ORDER + 1.0)
        first = np.minimum(place.astype(int), self.count - ORDER)
        found = np.zeros((len(x), self.count))
        for i, weight in enumerate(_weights(place - first)):
            found[np.arange(len(x)), first + i] = weight
        return found


@njit(forceinline=True)
def _weights(s):  # type: ignore[no-untyped-def]  # compiled
    """Return the splines that are not zero at a share ``s`` of the way from one knot to the next."""
    r = 1.0 - s
    return (
        r * r * r / 6.0,
        (3.0 * s * s * s - 6.0 * s * s + 4.0) / 6.0,
        (3.0 * r * r * r - 6.0 * r * r + 4.0) / 6.0,
        s * s * s / 6.0,
    )


@njit
def _place(axis, time, theta, omega, v, curve):  # type: ignore[no-untyped-def]  # compiled
    """Return the first spline that is not zero along an axis, and the share of the way to the next knot."""
    kind = curve[axis]
    if kind == ANGLE:
        x = theta
    elif kind == VELOCITY:
        x = omega
    elif kind == COMMAND:
        x = v
    elif kind == PHASE:
        cycles = (time - curve[9]) / curve[8]
        x = cycles - np.floor(cycles)
    else:
        x = time
    last, at = curve[axis + 3] - 4.0, (x - curve[axis + 1]) / curve[axis + 2]
    if not at > 0.0:  # nor where the plant diverges
        at = 0.0
    at = min(at, last + 1.0)
    first = min(np.floor(at), last)
    return int(first), at - first


@ports.dynamics
def curve_torque(time, theta, omega, v, abc, states, curve, derivatives):  # type: ignore[no-untyped-def]
    """Return the angular acceleration of a curve, rad/s²; ``curve`` contains header and coefficients.

    A curve over the phase is zero where the command has no period.
    """
    width = int(curve[7])
    if curve[8] == 0.0 and (curve[0] == PHASE or (width > 1 and curve[4] == PHASE)):
        return 0.0
    first, share = _place(0, time, theta, omega, v, curve)
    x = _weights(share)
    at = 10 + first * width
    if width == 1:
        return x[0] * curve[at] + x[1] * curve[at + 1] + x[2] * curve[at + 2] + x[3] * curve[at + 3]
    second, share = _place(4, time, theta, omega, v, curve)
    y = _weights(share)
    total = 0.0
    for i in range(4):
        k = at + i * width + second
        total += x[i] * (y[0] * curve[k] + y[1] * curve[k + 1] + y[2] * curve[k + 2] + y[3] * curve[k + 3])
    return total
