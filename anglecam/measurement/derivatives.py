"""Velocity and acceleration of a measured angle, by a smoother whose width follows from noise and motion.

The motion is modelled as one whose derivative of order p is white noise (`anglecam.measurement.wiener_smoother`). Of
measurement noise with variance r, and white noise of intensity q, frames at intervals Δ are averaged over a memory of

    L = (r/(q·Δ^(2p − 1)))^(1/2p)   frames

so L is short where the motion is rough and long at rest. Nobody states it: it is found from the angles, in four steps.

1. Smooth the recording with each of several memories, from one that follows every frame to one that takes all frames
   for one polynomial.
2. Predict each frame from all others, which needs no further pass: of a smoothed value with variance V the error is
   (y − θ)/(1 − V/r) and its variance r/(1 − V/r) (Craven and Wahba, Numer. Math. 31, 1979).
3. From these errors, find the memory of each frame (`anglecam.measurement.switching`), as the mean of log L.
4. Smooth once more, with the intensity that belongs to each frame's memory.

p is 3, 4 or 5, whichever predicts best. Beforehand, the size of the noise is known with `FREEDOM` degrees of freedom;
each frame of step 2 adds one. So the stated sigma sets the noise of a short recording, the scatter that of a long one.

The error that all frames share scales the motion, so velocity and acceleration have it as the same share. What the
model cannot know is a jump of the velocity between two frames, as in an impact: there the error exceeds its sigma.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from anglecam.data.derivatives import Derivatives
from anglecam.data.series import AngleSeries
from anglecam.data.typing import Floats
from anglecam.measurement.switching import model_probabilities
from anglecam.measurement.wiener_smoother import smooth

FREEDOM = 20.0
"""Degrees of freedom of the stated noise; its relative uncertainty is 1/√(2·20), a sixth (GUM, G.3.3)."""
ORDERS = (3, 4, 5)
"""Orders of the derivative that is white noise; below 3 there is no acceleration."""
LEAST_FRAMES = max(ORDERS) + 1
"""Measured frames below which nothing is stated: one more than a motion without noise has unknowns."""
_WHOLE = 6.0
"""Frames per memory of a recording from which on it is smoothed by one polynomial: the smoother has n/(3·L) degrees of
freedom away from the ends, and a polynomial has p."""
_LONGEST = 256.0
"""Longest memory, frames; one that is longer gains nothing that the common part of the uncertainty would not hide."""
_VAGUE = 1e3
"""Standard deviation of the first state in units of the largest difference quotients: nothing is known of it."""
_LEAST_NOISE = 1e-9
"""Noise that is assumed at least, rad; less than the rounding of any file."""
_ROUNDS = 20
"""Most rounds in which noise and memories are made to agree; 2 to 5 are usual."""
_SETTLED = 1e-3
"""Relative change of the noise's variance that ends them."""


@dataclass(frozen=True)
class _Smoothed:
    """A recording of n frames, smoothed; in units in which the median noise and the median interval are 1."""

    mean: Floats
    """(n, 3) θ and two derivatives."""
    variance: Floats
    """(n, 3)"""
    score: float
    """Log-likelihood of the frames, each predicted from all others."""


def with_derivatives(series: AngleSeries) -> AngleSeries:
    """Return a series with velocity and acceleration; ``derivatives`` is ``None`` where its sigma is not stated.

    Parameters
    ----------
    series : AngleSeries
        Measured, or read from a file that has ``sigma_deg``.

    Returns
    -------
    AngleSeries
        With new `AngleSeries.derivatives`; NaN throughout with fewer than `LEAST_FRAMES` measured frames.
    """
    ok = series.ok
    stated = series.sigma if series.sigma_random is None else series.sigma_random
    if not np.isfinite(stated[ok]).all():
        return replace(series, derivatives=None)
    share = np.nan_to_num(series.common_share)
    found = derivatives(series.time[ok], series.angle[ok], stated[ok])

    def in_all_frames(values: Floats) -> Floats:
        placed = np.full(len(ok), np.nan)
        placed[ok] = values
        return placed

    velocity, acceleration = in_all_frames(found.velocity), in_all_frames(found.acceleration)
    return replace(
        series,
        derivatives=Derivatives(
            velocity,
            np.hypot(in_all_frames(found.velocity_sigma), share * velocity),
            acceleration,
            np.hypot(in_all_frames(found.acceleration_sigma), share * acceleration),
        ),
    )


def derivatives(time: Floats, angle: Floats, noise: Floats) -> Derivatives:
    """Return velocity and acceleration of an angle with errors that are independent from frame to frame.

    Parameters
    ----------
    time : ndarray
        (n,) s, increasing at any intervals.
    angle : ndarray
        (n,) rad.
    noise : ndarray
        (n,) standard uncertainty of each angle, rad.

    Returns
    -------
    Derivatives
        (n,) each; NaN with fewer than `LEAST_FRAMES` frames.

    Examples
    --------
    >>> time = np.arange(300) / 60
    >>> angle = 0.2 * np.sin(6.0 * time) + 1e-4 * np.random.default_rng(0).standard_normal(300)
    >>> found = derivatives(time, angle, np.full(300, 1e-4))
    >>> pull = (found.velocity - 1.2 * np.cos(6.0 * time)) / found.velocity_sigma
    >>> bool(np.sqrt(np.mean(pull**2)) < 1.4)
    True
    """
    if len(time) < LEAST_FRAMES:
        return Derivatives(*(np.full(len(time), np.nan) for _ in range(4)))
    noise = np.maximum(noise, _LEAST_NOISE)
    interval, scale = float(np.median(np.diff(time))), float(np.median(noise))
    steps, value, variance = (time - time[0]) / interval, (angle - angle[0]) / scale, (noise / scale) ** 2
    best = max((_smoothed(steps, value, variance, order) for order in ORDERS), key=lambda one: one.score)
    unit = scale / interval ** np.arange(3)
    (_, velocity, acceleration), sigma = (best.mean * unit).T, (np.sqrt(best.variance) * unit).T
    return Derivatives(velocity, sigma[1], acceleration, sigma[2])


def _smoothed(time: Floats, value: Floats, variance: Floats, order: int) -> _Smoothed:
    """Smooth with the memory that each frame shows."""
    bends = _largest_derivatives(time, value, order)
    spread = _VAGUE * (1.0 + np.array([0.0, *bends[: order - 1]]))
    shortest, longest = (1.0 + bends[-1]) ** (-1.0 / order), min(max(len(time) / _WHOLE, 2.0), _LONGEST)
    memories = np.geomspace(shortest, longest, 1 + int(np.ceil(np.log2(longest / shortest))))
    tried = [smooth(time, value, variance, spread, _intensity(memory, order)) for memory in memories]
    left_out = [_left_out(value, variance, *one) for one in tried]
    errors, spreads = (np.stack(parts, axis=1) for parts in zip(*left_out, strict=True))
    factor = 1.0
    for _ in range(_ROUNDS):
        chosen = model_probabilities(-0.5 * (errors / factor + np.log(factor * spreads)))
        before, factor = factor, _noise_factor((chosen * errors).sum(axis=1))
        if abs(factor - before) < _SETTLED * factor:
            break
    memory = chosen @ np.log(memories)
    memory[1:] = 0.5 * (memory[1:] + memory[:-1])  # of the interval before each frame
    mean, variances = smooth(time, value, variance, spread, _intensity(np.exp(memory), order))
    error, spread_of = _left_out(value, variance, mean, variances)
    factor = _noise_factor(error)
    score = -0.5 * float((error / factor + np.log(factor * spread_of)).sum())
    return _Smoothed(mean[:, :3], factor * variances[:, :3], score)


def _largest_derivatives(time: Floats, value: Floats, order: int) -> list[float]:
    """Return the largest difference quotients of orders 1 to ``order``; of intervals below a tenth, as of a tenth."""
    largest = []
    for _ in range(order):
        value, time = np.diff(value) / np.maximum(np.diff(time), 0.1), time[:-1]
        largest.append(float(np.abs(value).max()))
    return largest


def _intensity(memory: Floats | float, order: int) -> Floats:
    """Return q that belongs to a memory L, with Δ and r of 1."""
    return np.asarray(memory) ** (-2.0 * order)


def _left_out(value: Floats, variance: Floats, mean: Floats, variances: Floats) -> tuple[Floats, Floats]:
    """Return the squared error of each frame, predicted from all others, by its variance; and that variance."""
    left = np.maximum(1.0 - variances[:, 0] / variance, np.finfo(float).eps)
    return (value - mean[:, 0]) ** 2 / (left * variance), variance / left


def _noise_factor(errors: Floats) -> float:
    """Return the variance of the noise by the stated one, from squared errors by their stated variance."""
    return float((FREEDOM + errors.sum()) / (FREEDOM + len(errors)))
