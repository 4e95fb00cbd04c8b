"""The paper's estimator: an extended Kalman filter on the state (θ, θ̇, a, b, c), iterated.

A single pass linearises about a running estimate that is still wrong, and it never corrects the errors of that
linearisation: from starts up to 80 % off, its variance is two to eight times the Cramér–Rao bound
(benchmarks/estimators.py). The filter is therefore passed through the recordings again. From the second pass on it is
linearised about a whole trajectory, computed from the parameters and the smoothed initial states at the end of the pass
before: the iterated extended Kalman smoother (Bell, SIAM J. Optim. 4, 1994). Every pass begins with the initial
variances, centred on the result of the pass before, so no measurement counts twice. The initial variance limits the
step of a pass, as the damping of Levenberg and Marquardt does (Särkkä and Svensson, ICASSP 2020), and it exerts no pull
where the passes converge. They converge to the minimum of output error with white noise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from anglecam.data.record import Record
from anglecam.data.typing import Floats
from anglecam.identification.kalman import SHARED, Filtered, filter_record
from anglecam.identification.smoothing import smooth_first_states
from anglecam.models.plant import Plant

SETTLED = 1e-3
"""Passes end when no parameter moves by more than this share of its standard uncertainty."""
SHRINKAGE = 0.1
"""Factor by which the initial standard deviations of the parameters shrink after a pass that ends with a worse fit."""
FINAL_SPREAD = 100.0
"""Multiple of the initial standard deviations in the last pass, so that the stated covariance comes from the data."""
LEAST_NOISE = 1e-6
"""Least standard deviation of the noise, as a share of the swing. A frame's information is its inverse square, and in
double precision little is left of the initial information beside 10¹² times as much."""
RESOLUTION = math.radians(1e-6)
"""rad; last decimal of an angle in a file, the least swing that is distinguished from none."""


@dataclass(frozen=True)
class EkfSettings:
    """Tuning of the filter."""

    initial_variance: tuple[float, float, float, float, float]
    """Diagonal of P₀ for θ (rad²), θ̇ (rad²/s²), a (1/s²), b (1/s⁴), c (1/s⁴)."""
    process_variance: float
    """Diagonal of Q over one frame interval, in the square of each state's unit."""
    measurement_variance: float
    """r, rad²."""
    passes: int
    """Most passes through the recordings."""
    zero_variance: float = 0.0
    """Variance of a recording's zero where it is not declared, rad²; 0 keeps the paper's five states."""


PAPER = EkfSettings((1000.0,) * 5, 0.001, 0.0001, 1)
"""The paper's settings: P₀ = 1000·I, Q = 0.001, r = 0.0001, one pass."""


@dataclass(frozen=True)
class EkfEstimate:
    """Result of the filter."""

    parameters: Floats
    """(3,) a (1/s), b (1/s²), c (1/s²)."""
    covariance: Floats
    """(3, 3), SI."""
    filtered: tuple[Filtered, ...]
    """The last pass, recording by recording; input of `anglecam.identification.smoothing.smooth`."""
    passes: int
    """Passes made."""
    settled: bool
    """Whether the last of several passes changed nothing; also True if only one pass was requested. Otherwise
    ``covariance`` is that of a pass whose initial variances were as small as its step had to be, and no uncertainty."""

    @property
    def innovations(self) -> tuple[Floats, ...]:
        """Each recording's measured minus predicted angle, one frame ahead, rad."""
        return tuple(one.innovation for one in self.filtered)

    @property
    def normalised(self) -> tuple[Floats, ...]:
        """The innovations divided by the standard deviation that the filter predicts for them."""
        return tuple(one.normalised for one in self.filtered)

    @property
    def fitted(self) -> int:
        """Number of unknowns fitted to the data that the innovations come from; 0 after a single pass."""
        if self.passes == 1:
            return 0
        nuisance = sum(int(np.sum(np.diag(one.covariance[0]) > 0.0)) - self.shared for one in self.filtered)
        return nuisance + self.shared

    @property
    def shared(self) -> int:
        """Number of parameters with an uncertainty: 3, or 2 where no recording is driven."""
        return int(np.sum(np.diag(self.covariance) > 0.0))


def settings_for(records: Sequence[Record], start: Floats, sigma: float) -> EkfSettings:
    """Return the tuning for constant parameters and a start that may be far off.

    Parameters
    ----------
    records : sequence of Record
        Recordings to filter.
    start : (3,) ndarray
        a, b, c to start from.
    sigma : float
        Standard deviation of the angle's noise, rad.

    Returns
    -------
    EkfSettings
        With Q = 0: the parameters are constant, and their stated covariance is that of an estimate.
    """
    swing = max(RESOLUTION, *(float(np.ptp(r.angle)) for r in records))
    rate = swing * float(np.sqrt(abs(start[1])))
    a, b, c = (float(max(abs(s), 1.0)) ** 2 for s in start)
    return EkfSettings((swing**2, rate**2, a, b, c), 0.0, max(sigma, LEAST_NOISE * swing) ** 2, 30, swing**2)


def fit_ekf(records: Sequence[Record], start: Floats, settings: EkfSettings) -> EkfEstimate:
    """Estimate a, b, c by an extended Kalman filter.

    Parameters
    ----------
    records : sequence of Record
        Filtered one after another; each starts with its nuisance state and the parameters so far.
    start : (3,) ndarray
        a (1/s), b (1/s²), c (1/s²).
    settings : EkfSettings
        Tuning.

    Returns
    -------
    EkfEstimate
        c and its variance are zero where no recording is driven.

    Raises
    ------
    ValueError
        If several passes are requested with process noise: the trajectory to linearise about is then no free run.
    """
    if settings.passes > 1 and settings.process_variance > 0.0:
        raise ValueError("passes beyond the first need a process variance of 0")
    parameters = np.clip(start, Plant().lower, Plant().upper)
    variance = np.array(settings.initial_variance)
    if not any(r.command is not None for r in records):
        parameters[2] = variance[4] = 0.0
    nuisance = [_first_state(record, settings) for record in records]
    with np.errstate(
        over="ignore", invalid="ignore"
    ):  # a pass may diverge; its cost is then not finite and the pass is rejected
        passed = _pass(records, parameters, nuisance, variance, settings)
        if settings.passes == 1:
            return EkfEstimate(*_ended(passed), passed, 1, True)
        return _iterated(records, parameters, nuisance, variance, settings, passed)


def _iterated(
    records: Sequence[Record],
    parameters: Floats,
    nuisance: Sequence[Floats],
    variance: Floats,
    settings: EkfSettings,
    passed: tuple[Filtered, ...],
) -> EkfEstimate:
    """Repeat the pass, each time about the trajectory of the best result so far, until the parameters settle."""
    cost, trust, count = _cost(records, parameters, nuisance), 1.0, 1
    best, covariance = passed, np.diag(variance[SHARED])
    while True:
        ended, ended_covariance = _ended(passed)
        ended_cost = np.inf
        if np.isfinite(ended_covariance).all():  # the pass did not diverge
            ended_nuisance = [np.delete(state, SHARED) for state in smooth_first_states(passed)]
            ended_cost = _cost(records, ended, ended_nuisance)
        moved = np.abs(ended - parameters)
        settled = (
            trust == FINAL_SPREAD
            and bool(np.isfinite(ended_cost))
            and bool(np.all(moved <= SETTLED * np.sqrt(np.diag(ended_covariance))))
        )
        if settled or (ended_cost <= cost and np.isfinite(ended_cost)):
            best, parameters, covariance, nuisance, cost = passed, ended, ended_covariance, ended_nuisance, ended_cost
            trust = min(FINAL_SPREAD, trust / SHRINKAGE)
        else:
            trust *= SHRINKAGE
        if settled or count == settings.passes:
            return EkfEstimate(parameters, covariance, best, count, settled)
        held = np.concatenate([variance[:2], trust**2 * variance[SHARED]])
        about = [_free_run(record, parameters, o) for record, o in zip(records, nuisance, strict=True)]
        passed = _pass(records, parameters, nuisance, held, settings, about)
        count += 1


def _pass(
    records: Sequence[Record],
    parameters: Floats,
    nuisance: Sequence[Floats],
    variance: Floats,
    settings: EkfSettings,
    about: Sequence[Floats] | None = None,
) -> tuple[Filtered, ...]:
    """Pass once through all recordings; each begins with the parameters at the end of the recording before."""
    passed: list[Filtered] = []
    mean, covariance = parameters, np.diag(variance[SHARED])
    for i, record in enumerate(records):
        first = np.concatenate([nuisance[i][:2], mean, nuisance[i][2:]])
        P = np.zeros((len(first), len(first)))
        P[:2, :2], P[SHARED, SHARED], P[5:, 5:] = np.diag(variance[:2]), covariance, settings.zero_variance
        one = filter_record(
            record,
            first,
            P,
            process_variance=settings.process_variance,
            measurement_variance=settings.measurement_variance,
            about=about[i] if about else None,
        )
        mean, covariance = one.state[-1, SHARED], one.covariance[-1, SHARED, SHARED]
        passed.append(one)
    return tuple(passed)


def _ended(passed: Sequence[Filtered]) -> tuple[Floats, Floats]:
    """Return the parameters (3,) and their covariance (3, 3) after the last frame."""
    return passed[-1].state[-1, SHARED], passed[-1].covariance[-1, SHARED, SHARED]


def _free_run(record: Record, parameters: Floats, nuisance: Floats) -> Floats:
    """Return the (n, s) trajectory of constant parameters from a recording's nuisance first state."""
    moving = Plant().run(parameters, record.time, record.command, nuisance[:2])
    return np.column_stack([moving, np.tile(np.concatenate([parameters, nuisance[2:]]), (len(moving), 1))])


def _cost(records: Sequence[Record], parameters: Floats, nuisance: Sequence[Floats]) -> float:
    """Return the free run's sum of squared errors, rad²; infinite if it diverges or the plant is an impossible one."""
    if not np.all((Plant().lower <= parameters) & (parameters <= Plant().upper)):
        return np.inf
    total = 0.0
    for record, o in zip(records, nuisance, strict=True):
        run = _free_run(record, parameters, o)
        total += float(np.sum((record.angle - run[:, 0] - o[2:].sum()) ** 2))
    return total if np.isfinite(total) else np.inf


def _first_state(record: Record, settings: EkfSettings) -> Floats:
    """Return a recording's first state: its first angle, at rest if it has a command, else the first frames' rate."""
    few = min(3, len(record.time))
    rate = 0.0 if record.command else np.polyfit(record.time[:few], record.angle[:few], 1)[0]
    nuisance = np.array([record.angle[0], rate])
    return nuisance if record.zero_known or settings.zero_variance == 0.0 else np.append(nuisance, 0.0)
