"""The linear plant between two stops, exact to rounding: θ̈ = c·v − a·θ̇ − b·θ by Taylor series."""

from __future__ import annotations

import numpy as np
from numba import njit

TERMS = 16
"""Terms of the series. Its steps are no longer than the plant's time constants, and 1/18! is less than rounding."""
_FACTORS = np.array([1.0 / ((k + 1) * (k + 2)) for k in range(TERMS)])
ROUNDING = 1e-17
"""rad; the series ends where two successive terms are smaller."""
SETTLED = 1e-13
"""rad; a smaller transient of the lag counts as settled."""


@njit
def advance_linear(theta, omega, span, segment, lag, abc):  # type: ignore[no-untyped-def]  # compiled
    """Advance the linear plant by ``span`` seconds, in steps no longer than its time constants."""
    pace = max(abs(abc[0]), np.sqrt(abs(abc[1])))
    at = 0.0
    while at < span:
        transient = segment[2] * np.exp(-at / lag) if lag > 0.0 else 0.0
        if abs(transient) < SETTLED:
            transient = 0.0
        fastest = max(pace, 1.0 / lag) if transient != 0.0 else pace
        h = span - at
        pieces = np.ceil(h * fastest)
        if pieces > 1.0:
            h /= pieces
        theta, omega = _taylor_step(
            theta, omega, h, segment[0] + segment[1] * (at - lag), segment[1], transient, lag, abc
        )
        at = at + h if pieces > 1.0 else span
    return theta, omega


@njit
def _taylor_step(theta, omega, h, level, slope, transient, lag, abc):  # type: ignore[no-untyped-def]  # compiled
    """Sum the Taylor series of θ over a step: θ̈ = c·v − aθ̇ − bθ gives each term from the two terms before it."""
    damping, stiffness, drive = abc[0] * h, abc[1] * h * h, abc[2] * h * h
    before, last = theta, omega * h
    angle, rate = before + last, last
    decay = -h / lag if transient != 0.0 else 0.0
    forced, fading = drive * level, drive * transient
    for k in range(TERMS):
        term = (forced + fading - damping * (k + 1) * last - stiffness * before) * _FACTORS[k]
        before, last = last, term
        angle += last
        rate += (k + 2) * last
        forced = drive * slope * h if k == 0 else 0.0
        fading *= decay / (k + 1)
        if k > 1 and abs(last) + abs(before) + abs(fading) < ROUNDING:
            break
    return angle, rate / h
