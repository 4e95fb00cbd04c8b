"""The step response of a linear system, exact at every instant, and its rise, overshoot and settling.

With θ(s)/U(s) = N(s)/D(s) in controller form ẋ = A·x + B·u, θ = C·x, a unit step from rest gives

    θ(t) = C·(1 − e^{At})·x∞,   x∞ = −A⁻¹·B,

so level crossings and extremes are roots of known functions instead of samples of a simulation, and the figures are as
smooth in the parameters as their definitions.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from anglecam.data.step_figures import HIGH, LOW, NO_STEP, SETTLED, StepFigures
from anglecam.data.typing import Floats

_DECAYS = 12.0
"""Time constants of the slowest pole that are evaluated; e⁻¹² is far below the settling band."""
_PER_RADIAN = 10.0
"""Points per radian of the fastest pole, so that at most one level is crossed between two points."""
_FEWEST, _MOST = 500, 1_000_000
"""Limits on the number of points; the upper one resolves a fastest pole 1e5 times the slowest."""
_TERMS = 12
"""Terms of a Taylor series within a tenth of a radian: the thirteenth is below 1e-20."""


def linear_step(numerator: ArrayLike, denominator: ArrayLike, time: ArrayLike) -> Floats:
    """Return the response of a stable or unstable system to a unit step.

    Parameters
    ----------
    numerator, denominator : array_like
        Coefficients, highest power of s first; strictly proper.
    time : (n,) array_like
        Instants from the step, s; not negative.

    Returns
    -------
    (n,) ndarray
        Output per unit of input.

    Raises
    ------
    ValueError
        If the transfer function is not strictly proper.
    """
    A, B, C = _realise(numerator, denominator)
    order = len(B)
    # The step is one more, constant state. This needs no inverse of A, which an integrator does not have.
    driven = np.zeros((order + 1, order + 1))
    driven[:order, :order], driven[:order, order] = A, B
    instants = np.asarray(time, dtype=float)
    fastest, end = float(np.abs(np.linalg.eigvals(A)).max()), float(instants.max(initial=0.0))
    count = max(1, int(np.ceil(end * fastest * _PER_RADIAN)))
    width = max(end, np.finfo(float).tiny) / count
    before = np.minimum((instants / width).astype(int), count - 1)
    states = _orbit(_exponential(driven * width), np.eye(order + 1)[-1], count)[:, before]
    terms = _series(driven * width, states)
    rest = instants / width - before
    moved = np.einsum("kn,kin->in", rest ** np.arange(_TERMS)[:, None], terms)
    return np.asarray(C @ moved[:order])


def linear_step_figures(numerator: ArrayLike, denominator: ArrayLike) -> StepFigures:
    """Return rise (10-90 %), overshoot, settling (2 %) and steady state of the response to a unit step.

    Parameters
    ----------
    numerator, denominator : array_like
        Coefficients, highest power of s first; strictly proper.

    Returns
    -------
    StepFigures
        All NaN for a system that is not stable or has the steady state zero.

    Raises
    ------
    ValueError
        If the transfer function is not strictly proper.
    """
    from scipy.optimize import brentq  # SciPy takes most of a second to load

    A, B, C = _realise(numerator, denominator)
    poles = np.linalg.eigvals(A)
    slowest = -float(poles.real.max())
    if slowest <= 0.0:
        return NO_STEP
    rest = np.asarray(-np.linalg.solve(A, B), dtype=np.float64)
    gain = float(C @ rest)
    if gain == 0.0:
        return NO_STEP
    end = _DECAYS / slowest
    count = int(np.clip(end * float(np.abs(poles).max()) * _PER_RADIAN, _FEWEST, _MOST))
    width = end / count
    states = _orbit(_exponential(A * width), rest, count + 1)
    remaining = C / gain  # maps a state to the share of the way that remains
    speed = remaining @ A

    def when(row: Floats, first: int, level: float) -> float:
        """Return the time after point ``first`` at which ``row`` of the state passes a level."""
        terms = _series(A * width, states[:, first]) @ row
        terms[0] -= level
        highest_first = terms[::-1].tolist()

        def difference(share: float) -> float:
            """Evaluate by Horner's rule; NumPy's `Polynomial` takes ten times as long for a single number."""
            total = 0.0
            for term in highest_first:
                total = total * share + term
            return total

        if difference(0.0) * difference(1.0) >= 0.0:  # the level is passed at one of the two points, to the last digit
            return width * (first + float(abs(difference(1.0)) < abs(difference(0.0))))
        return width * (first + float(brentq(difference, 0.0, 1.0, xtol=1e-13)))

    def reached(share: float) -> float:
        return when(remaining, int(np.argmax(remaining @ states <= 1.0 - share)) - 1, 1.0 - share)

    shares, speeds = remaining @ states, speed @ states
    lowest = int(np.argmin(shares))
    overshoot = max(0.0, -float(shares[lowest]))
    if overshoot > 0.0:
        before = lowest - 1 if speeds[lowest] > 0.0 else lowest
        crest = when(speed, before, 0.0) - width * before
        overshoot = max(overshoot, -float(remaining @ _exponential(A * crest) @ states[:, before]))
    outside = int(np.flatnonzero(np.abs(shares) > SETTLED)[-1])
    settled = when(remaining, outside, float(np.copysign(SETTLED, shares[outside])))
    return StepFigures(reached(HIGH) - reached(LOW), overshoot, settled, gain)


def _realise(numerator: ArrayLike, denominator: ArrayLike) -> tuple[Floats, Floats, Floats]:
    """Return A, B and C of the controller form."""
    from scipy.linalg import companion

    above = np.trim_zeros(np.atleast_1d(np.asarray(numerator, dtype=float)), "f")
    below = np.trim_zeros(np.atleast_1d(np.asarray(denominator, dtype=float)), "f")
    if len(above) >= len(below):
        raise ValueError("a step response needs a strictly proper system: the degree of the numerator is too high")
    order = len(below) - 1
    B, C = np.zeros(order), np.zeros(order)
    B[0] = 1.0
    C[order - len(above) :] = above / below[0]
    return companion(below), B, C


def _orbit(step: Floats, start: Floats, count: int) -> Floats:
    """Return ``count`` successive states, (order, count)."""
    states, power = start[:, None], step
    while states.shape[1] < count:
        states = np.hstack([states, power @ states])
        power = power @ power
    return np.asarray(states[:, :count])


def _exponential(step: Floats) -> Floats:
    """Return e^step.

    Not scipy's: for a small matrix its threads cost a thousand times as much as the arithmetic.
    """
    size = float(np.abs(np.linalg.eigvals(step)).max())
    halvings = max(0, int(np.ceil(np.log2(max(size * _PER_RADIAN, 1.0)))))
    power = _series(step / 2.0**halvings, np.eye(len(step))).sum(axis=0)
    for _ in range(halvings):
        power = power @ power
    return np.asarray(power)


def _series(step: Floats, start: Floats) -> Floats:
    """Return the Taylor terms of e^{step·x}·start, (terms, *start.shape)."""
    terms = [start]
    for power in range(1, _TERMS):
        terms.append(step @ terms[-1] / power)
    return np.array(terms)
