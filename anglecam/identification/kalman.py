"""One pass of an extended Kalman filter through a recording, with filterpy.

    state (θ, θ̇, a, b, c[, z]):   θ̈ = c·u − a·θ̇ − b·θ,   ȧ = ḃ = ċ = ż = 0                        (Eq. (30))
    measured: θ + z + noise of variance r

z is the zero of a recording's angle, an additional state where it is not declared. Between two frames, at any distance,
the mean is integrated as in the other estimators, and the derivative of that integration is the filter's F.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from numba import njit, types

from anglecam.data.command import NO_COMMAND, Command
from anglecam.data.record import Record
from anglecam.data.typing import Floats
from anglecam.models.array_types import READ_COUNTS, READ_MATRIX, READ_TABLE, READ_VECTOR, VECTOR
from anglecam.models.integrator import integrate
from anglecam.models.plant import MAX_STEP, Plant
from anglecam.models.stepping import SCRATCH_ROWS

SHARED = slice(2, 5)
"""Position of a, b, c in the state; the other states are nuisance parameters of the recording."""
_STEPS = np.array([0.1, 1.0, 1.0, 10.0, 10.0])
"""Smallest magnitudes of θ, θ̇, a, b, c, SI, that scale the steps of difference quotients."""
_FARTHEST = 100.0 * Plant().upper
"""Magnitudes of a, b, c from which on the estimate has diverged; the integrator's steps are no longer than the plant's
time constants, so that it would never end."""
_NO_PIECES = (Plant().pieces.table, Plant().pieces.edges)


@dataclass(frozen=True)
class Filtered:
    """Result of one pass through a recording of n frames; s states: 5, or 6 with the zero."""

    state: Floats
    """(n, s) after each frame, SI."""
    covariance: Floats
    """(n, s, s) after each frame, SI."""
    prior: Floats
    """(n, s) state before each frame."""
    prior_covariance: Floats
    """(n, s, s) before each frame."""
    transition: Floats
    """(n, s, s) F from the frame before to each frame; for the first, the matrix that keeps only the parameters."""
    process: Floats
    """(n, s, s) Q between the frame before and each frame; for the first, the prior covariance without parameters."""
    measurement_variance: float
    """r, rad²."""
    gain: Floats
    """(n, s) Kalman gain."""
    innovation: Floats
    """(n,) measured minus predicted angle, one frame ahead, rad."""
    innovation_variance: Floats
    """(n,) S, rad²."""

    @property
    def normalised(self) -> Floats:
        """(n,) innovations divided by the standard deviation that the filter predicts for them."""
        return self.innovation / np.sqrt(self.innovation_variance)


class _Filter(ExtendedKalmanFilter):
    """filterpy's filter with the nonlinear prediction, which filterpy leaves to a subclass."""

    def __init__(self, states: int) -> None:
        super().__init__(dim_x=states, dim_z=1)
        self.predicted = np.zeros(states)

    def predict_x(self, u: object = 0) -> None:
        """Use the integrated mean in place of F·x."""
        self.x = self.predicted


class RunningFilter:
    """The filter between two frames and at a frame; `filter_record` passes it through a recording.

    Parameters
    ----------
    mean, covariance, process_variance, measurement_variance
        As for `filter_record`.
    command : Command, optional
        Without it the plant is not driven.
    interval : float
        Interval over which ``process_variance`` is added, s.
    """

    def __init__(
        self,
        mean: Floats,
        covariance: Floats,
        command: Command | None,
        interval: float,
        process_variance: float,
        measurement_variance: float,
    ) -> None:
        states = len(mean)
        self._command = command or NO_COMMAND
        self._interval = interval
        self._H = observation_matrix(states)
        self._drift = process_variance * np.eye(states)
        self._drift[np.diag(covariance) == 0.0] = 0.0
        self._drift[5:] = 0.0
        self.ekf = _Filter(states)
        """Its ``x``, ``P``, ``F``, ``Q``, ``K``, ``y`` and ``S`` are those of the last frame."""
        self.ekf.x, self.ekf.P = mean.copy(), covariance.copy()
        self.ekf.R = np.array([[measurement_variance]])

    @property
    def diverged(self) -> bool:
        """Whether the estimate is not finite, or too far away to be integrated."""
        x, P = self.ekf.x, self.ekf.P
        return not (np.isfinite(x).all() and np.isfinite(P).all() and (np.abs(x[SHARED]) < _FARTHEST).all())

    def predict(self, before: float, time: float, about: Floats | None = None) -> None:
        """Predict the state at ``time`` from that at ``before``, s; ``about`` is the state to linearise about."""
        origin = self.ekf.x if about is None else about
        reached, self.ekf.F = _advance(origin, np.array([before, time]), self._command)
        self.ekf.Q = (time - before) / self._interval * self._drift
        self.ekf.predicted = reached + self.ekf.F @ (self.ekf.x - origin)
        self.ekf.predict()

    def update(self, angle: float) -> None:
        """Correct the state by a measured angle, rad; not finite where the filter states no variance for it."""
        variance = (self._H @ self.ekf.P @ self._H.T + self.ekf.R).item()
        if not 0.0 < variance < np.inf:
            self.ekf.x = np.full_like(self.ekf.x, np.nan)
            return
        self.ekf.update(np.array([angle]), HJacobian=lambda _: self._H, Hx=lambda x: self._H @ x)


def filter_record(
    record: Record,
    mean: Floats,
    covariance: Floats,
    *,
    process_variance: float,
    measurement_variance: float,
    about: Floats | None = None,
) -> Filtered:
    """Pass an extended Kalman filter through a recording once.

    Parameters
    ----------
    record : Record
        Frames at any times.
    mean : (s,) ndarray
        θ (rad), θ̇ (rad/s), a (1/s), b (1/s²), c (1/s²) and perhaps z (rad) before the first frame.
    covariance : (s, s) ndarray
        Covariance of ``mean``; rows of zeros for known states.
    process_variance : float
        Diagonal of Q over one median frame interval, in the square of each state's unit; a gap adds in proportion to
        its length. States that are known at the start, and the zero, have no process noise.
    measurement_variance : float
        r, rad².
    about : (n, s) ndarray, optional
        Trajectory to linearise about; the filter's running estimate otherwise.

    Returns
    -------
    Filtered
        For the whole recording; not finite from the frame at which the estimate diverges.
    """
    n, s = len(record.time), len(mean)
    running = RunningFilter(mean, covariance, record.command, record.interval, process_variance, measurement_variance)
    ekf = running.ekf
    state, prior, gain = (np.full((n, s), np.nan) for _ in range(3))
    posterior, prior_covariance = np.full((n, s, s), np.nan), np.full((n, s, s), np.nan)
    transition, process = np.zeros((n, s, s)), np.zeros((n, s, s))
    transition[0, SHARED, SHARED], process[0] = np.eye(3), covariance
    process[0, SHARED, :] = process[0, :, SHARED] = 0.0
    innovation, variance = np.full(n, np.nan), np.full(n, np.nan)
    for i in range(n):
        if i > 0:
            running.predict(record.time[i - 1], record.time[i], None if about is None else about[i - 1])
            transition[i], process[i] = ekf.F, ekf.Q
        prior[i], prior_covariance[i] = ekf.x, ekf.P
        running.update(record.angle[i])
        if running.diverged:
            break
        state[i], posterior[i], gain[i] = ekf.x, ekf.P, ekf.K[:, 0]
        innovation[i], variance[i] = ekf.y[0], ekf.S[0, 0]
    return Filtered(
        state,
        posterior,
        prior,
        prior_covariance,
        transition,
        process,
        measurement_variance,
        gain,
        innovation,
        variance,
    )


def observation_matrix(states: int) -> Floats:
    """Return H (1, s): the measured angle is θ plus the zero z."""
    return np.array([[1.0, 0.0, 0.0, 0.0, 0.0, 1.0]])[:, :states]


def _advance(state: Floats, span: Floats, command: Command) -> tuple[Floats, Floats]:
    """Return the state integrated over ``span`` (2,) and the derivative of its end with respect to its start."""
    reached, F = state.copy(), np.eye(len(state))
    steps = 1e-5 * np.maximum(np.abs(state[:5]), _STEPS)
    reached[:2], F[:2, :5] = _flow(state[:5], span, command.knots, steps, *_NO_PIECES, MAX_STEP)
    return reached, F


@njit(
    types.Tuple((VECTOR, types.Array(types.float64, 2, "C")))(
        READ_VECTOR, READ_VECTOR, READ_MATRIX, READ_VECTOR, READ_TABLE, READ_COUNTS, types.float64
    ),
    cache=True,
)
def _flow(state, span, knots, steps, table, ports, max_step):  # type: ignore[no-untyped-def]  # compiled
    """Return the state of the plant after a span and its derivative, by central difference quotients."""
    slopes, none, memory = np.empty((2, 5)), np.empty(0), np.empty((1 + SCRATCH_ROWS, 0))
    edges, spans, near = np.array([0, 2]), np.array([[0, knots.shape[1]]]), np.empty((0, 2))
    ends = np.empty((11, 2))
    for j in range(11):
        moved = state.copy()
        if j < 10:
            moved[j // 2] += steps[j // 2] if j % 2 else -steps[j // 2]
        ends[j] = integrate(
            span, edges, moved[None, :2], knots, spans, 0.0, moved[2:], table, ports, none, memory, max_step, near
        )[1]
        if j % 2:
            low, high = state[j // 2] - steps[j // 2], state[j // 2] + steps[j // 2]
            slopes[:, j // 2] = (ends[j] - ends[j - 1]) / (high - low)
    return ends[10], slopes
