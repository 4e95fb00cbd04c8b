"""The paper's estimator: an extended Kalman filter on the state (θ, θ̇, a, b, c), with filterpy.

    θ̈ = c·u − a·θ̇ − b·θ,   ȧ = ḃ = ċ = 0                                    (Eq. (30))

Between two frames, whatever their distance, the mean is integrated exactly as the other estimators integrate it,
and its derivative is the filter's F. The parameters of one recording are where the next begins; the whole is
passed through until it no longer moves, because one pass from a poor start linearises about the wrong plant.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from numpy.typing import NDArray

from anglecam.estimate.record import Record
from anglecam.simulate.plant import Plant

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class EkfSettings:
    """Tuning of the filter."""

    initial_variance: tuple[float, float, float, float, float]
    """Diagonal of P₀ for θ (rad²), θ̇ (rad²/s²), a (1/s²), b (1/s⁴), c (1/s⁴)."""
    process_variance: float
    """Diagonal of Q, added at every frame."""
    measurement_variance: float
    """r, rad²."""
    passes: int
    """Times that the recordings are passed through at most."""


PAPER = EkfSettings((1000.0,) * 5, 0.001, 0.0001, 1)
"""The paper's settings: P₀ = 1000·I, Q = 0.001, r = 0.0001, one pass."""


@dataclass(frozen=True)
class EkfEstimate:
    """What the filter ends with."""

    parameters: Floats
    """(3,) a (1/s), b (1/s²), c (1/s²)."""
    covariance: Floats
    """(3, 3), SI."""
    innovations: tuple[Floats, ...]
    """Each recording's measured minus predicted angle, one frame ahead, rad."""
    normalised: tuple[Floats, ...]
    """The same divided by the filter's own standard deviation of it."""


class _Filter(ExtendedKalmanFilter):
    """filterpy's filter with the nonlinear prediction that it leaves to a subclass."""

    def __init__(self) -> None:
        super().__init__(dim_x=5, dim_z=1)
        self.predicted = np.zeros(5)

    def predict_x(self, u: object = 0) -> None:
        """Put the integrated mean in place of F·x."""
        self.x = self.predicted


def settings_for(records: Sequence[Record], start: Floats, sigma: float) -> EkfSettings:
    """Choose the tuning for recordings of noise ``sigma`` (rad): constant parameters, a start that may be half off.

    Parameters
    ----------
    records : sequence of Record
        What will be filtered.
    start : (3,) ndarray
        a, b, c to start from.
    sigma : float
        Standard deviation of the angle's noise, rad.

    Returns
    -------
    EkfSettings
        With Q = 0: the parameters do not drift, and what is stated of them is then a standard uncertainty.
    """
    swing = max(float(np.ptp(r.angle)) for r in records)
    rate = swing * float(np.sqrt(abs(start[1])))
    a, b, c = (float(0.5 * max(abs(s), 1.0)) ** 2 for s in start)
    return EkfSettings(((2.0 * sigma) ** 2, rate**2, a, b, c), 0.0, sigma**2, 12)


def fit_ekf(records: Sequence[Record], start: Floats, settings: EkfSettings) -> EkfEstimate:
    """Estimate a, b, c by an extended Kalman filter.

    Parameters
    ----------
    records : sequence of Record
        Filtered one after another; each starts with its own state and the parameters so far.
    start : (3,) ndarray
        a (1/s), b (1/s²), c (1/s²).
    settings : EkfSettings
        Tuning.

    Returns
    -------
    EkfEstimate
        c and its variance are zero where no recording is driven.
    """
    driven = any(r.command is not None for r in records)
    initial = np.diag(settings.initial_variance)
    parameters = np.array(start, dtype=float)
    if not driven:
        initial[4, 4], parameters[2] = 0.0, 0.0
    for _ in range(settings.passes):
        before = parameters
        covariance = initial[2:, 2:]
        results = []
        for record in records:
            parameters, covariance, *result = _filter(record, parameters, covariance, initial, settings)
            results.append(result)
        if not np.all(np.isfinite(parameters)):
            parameters = before
            break
        if np.all(np.abs(parameters - before) <= 1e-4 * np.abs(parameters) + 1e-9):
            break
    return EkfEstimate(parameters, covariance, tuple(r[0] for r in results), tuple(r[1] for r in results))


def _filter(record: Record, parameters: Floats, covariance: Floats, initial: Floats, settings: EkfSettings) -> tuple:
    plant = Plant()
    ekf = _Filter()
    few = min(3, len(record.time))
    resting = record.command is not None
    rate = 0.0 if resting else np.polyfit(record.time[:few], record.angle[:few], 1)[0]
    ekf.x = np.array([record.angle[0], rate, *parameters])
    ekf.P = np.zeros((5, 5))
    ekf.P[:2, :2] = initial[:2, :2]
    ekf.P[2:, 2:] = covariance
    ekf.Q = settings.process_variance * np.eye(5)
    if not record.command:
        ekf.Q[4, 4] = 0.0
    ekf.R = np.array([[settings.measurement_variance]])
    innovations, normalised = np.zeros(len(record.time)), np.zeros(len(record.time))

    def advance(x: Floats, i: int) -> Floats:
        states = plant.run(x[2:], record.time[i - 1 : i + 1], record.command, x[:2])
        return np.array([*states[1], *x[2:]])

    for i in range(1, len(record.time)):
        ekf.predicted = advance(ekf.x, i)
        steps = 1e-5 * np.maximum(np.abs(ekf.x), [0.1, 1.0, 1.0, 10.0, 10.0])
        ekf.F = np.column_stack(
            [(advance(ekf.x + d, i) - advance(ekf.x - d, i)) / (2.0 * d.sum()) for d in np.diag(steps)]
        )
        ekf.predict()
        ekf.update(
            np.array([record.angle[i]]),
            HJacobian=lambda _: np.array([[1.0, 0.0, 0.0, 0.0, 0.0]]),
            Hx=lambda x: x[:1],
        )
        innovations[i] = ekf.y[0]
        normalised[i] = ekf.y[0] / np.sqrt(ekf.S[0, 0])
    return ekf.x[2:].copy(), ekf.P[2:, 2:].copy(), innovations, normalised
