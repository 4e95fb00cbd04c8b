"""The paper's filter while the angle is measured: a, b and c of θ̈ + aθ̇ + bθ = cu after every frame.

It is one pass of `anglecam.identification.kalman`, with the paper's r and with constant parameters, Q = 0. It starts
from the parameters that fit the first frames best. The paper's r, (0.57°)², is far more than the noise of an angle. It
stands for what the model lacks, and it keeps the filter from trusting an early, wrong linearisation. The standard
uncertainties are those that the filter states with this r. `anglecam.identification.ekf` iterates, with the noise that
is measured.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anglecam.data.record import Record
from anglecam.identification.ekf import PAPER, settings_for
from anglecam.identification.initial_guess import start_parameters
from anglecam.identification.kalman import SHARED, RunningFilter

_UNKNOWN = (np.nan, np.nan, np.nan)


@dataclass(frozen=True)
class RunningEstimate:
    """The parameters after a frame."""

    values: tuple[float, float, float]
    """a (1/s), b (1/s²), c (1/s²); c is 0 where nothing is commanded, and all are NaN once the filter diverged."""
    sigmas: tuple[float, float, float]
    """Standard uncertainties that the filter states, in the same units."""


class RunningEkf:
    """The filter, frame by frame.

    Parameters
    ----------
    first : Record
        The first frames: the filter starts from the parameters that fit them best, and passes through them.
    """

    def __init__(self, first: Record) -> None:
        start = start_parameters([first], count=1)[0]
        driven = first.command is not None
        mean = np.concatenate([[first.angle[0], 0.0], start[:2], [start[2] if driven else 0.0]])
        variance = np.array(settings_for([first], mean[SHARED], 0.0).initial_variance)
        variance[4] *= driven
        if not first.zero_known:
            mean, variance = np.append(mean, 0.0), np.append(variance, variance[0])
        self._filter = RunningFilter(
            mean, np.diag(variance), first.command, first.interval, 0.0, PAPER.measurement_variance
        )
        self._time = float(first.time[0])
        self._diverged = False
        for time, angle in zip(first.time.tolist(), first.angle.tolist(), strict=True):
            self.add(time, angle)

    def add(self, time: float, angle: float) -> RunningEstimate:
        """Use the angle, rad, of the next frame, s, and return the parameters after it."""
        if self._diverged:
            return RunningEstimate(_UNKNOWN, _UNKNOWN)
        with np.errstate(over="ignore", invalid="ignore"):
            if time > self._time:
                self._filter.predict(self._time, time)
            self._filter.update(angle)
        self._time = time
        ekf = self._filter.ekf
        variance = np.diag(ekf.P)[SHARED]
        self._diverged = self._filter.diverged or not (variance >= 0.0).all()
        if self._diverged:
            return RunningEstimate(_UNKNOWN, _UNKNOWN)
        return RunningEstimate(tuple(ekf.x[SHARED].tolist()), tuple(np.sqrt(variance).tolist()))
