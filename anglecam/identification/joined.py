"""Recordings joined end to end: predictions, whitened residuals and their derivatives, of all recordings at once.

Shared parameters change the prediction of every recording, nuisance parameters only that of their own. One run through
all recordings therefore gives the derivatives with respect to one shared parameter, or to one nuisance parameter of
every recording.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from anglecam.data.record import Record
from anglecam.data.runs import Runs, runs_of
from anglecam.data.typing import Floats
from anglecam.identification.slopes import Slopes
from anglecam.models.model import Model
from anglecam.models.plant import Plant

STEP = 1e-6
"""Step of the difference quotients, as a share of a parameter's magnitude."""
NUISANCE_STEP = 0.1 * STEP
"""Step of the difference quotients for initial states, rad and rad/s."""
RUNAWAY = 1e100
"""rad; a larger angle counts as divergence: the squares of its derivatives would soon overflow."""


@dataclass(frozen=True)
class Predicted:
    """Prediction of all recordings."""

    angle: Floats
    """(N,) rad; NaN where the model diverges."""
    motion: Floats | None
    """(N, 2) angle and rate of a `Plant`, before the camera's effects."""


@dataclass(frozen=True)
class Joined:
    """R recordings with N frames in all, for fits with one AR(1) coefficient of the noise."""

    runs: Runs
    angle: Floats = field(repr=False)
    """(N,) measured angle, rad."""
    zero_fitted: NDArray[np.bool_]
    """(R,) whether the zero of each recording's angle is a nuisance parameter, its last one."""
    correlation: Floats = field(repr=False)
    """(N,) correlation of the noise with that of the frame before; 0 in the first frame of a recording."""

    def predict(self, model: Model, parameters: Floats, own: Floats, near: Floats | None = None) -> Predicted:
        """Predict all recordings in free run.

        Parameters
        ----------
        model : Model
            The model.
        parameters : (p,) ndarray
            Shared parameters, SI.
        own : (R, k) ndarray
            Nuisance parameters: initial states, then the zero (rad) if any recording has one to be fitted.
        near : (N, 2) ndarray, optional
            Motion with the same parameters from slightly different initial states; saves time.
        """
        first, motion = own[:, : model.states], None
        if isinstance(model, Plant):
            angle, motion = model.predict_all(parameters, self.runs, first, near)
        else:
            times = self.runs.split(self.runs.time)
            each = zip(times, self.runs.commands, first, self.runs.views, strict=True)
            angle = np.concatenate([model.predict(parameters, *one) for one in each])
        if self.zero_fitted.any():
            angle = angle + np.where(self.zero_fitted, own[:, -1], 0.0)[self.runs.owner]
        return Predicted(np.where(np.abs(angle) < RUNAWAY, angle, np.nan), motion)

    def stack(self, nuisance: Sequence[Floats]) -> Floats:
        """Return each recording's nuisance parameters as (R, k), with a zero for a zero that is declared."""
        own = np.zeros((len(nuisance), max(len(one) for one in nuisance)))
        for row, one in zip(own, nuisance, strict=True):
            row[: len(one)] = one
        return own

    def fitted(self, own: Floats) -> NDArray[np.bool_]:
        """Return which of the (R, k) nuisance parameters are fitted: all but the zeros that are declared."""
        which = np.ones(own.shape, bool)
        if self.zero_fitted.any():
            which[:, -1] = self.zero_fitted
        return which

    def errors(self, predicted: Predicted) -> Floats:
        """Return the (N,) whitened residuals, rad."""
        return self.whiten(self.angle - predicted.angle)

    def whiten(self, values: Floats) -> Floats:
        """Whiten (N,) or (N, k) values of all recordings; see `anglecam.identification.fit.whiten`."""
        if not self.correlation.any():
            return values
        correlation = self.correlation if values.ndim == 1 else self.correlation[:, None]
        before = np.concatenate([values[:1], values[:-1]])
        return (values - correlation * before) * (1.0 / np.sqrt(1.0 - correlation**2))

    def colour(self, white: Floats) -> Floats:
        """Return the (N, k) values that `whiten` turns into these."""
        coloured, scale = white.copy(), np.sqrt(1.0 - self.correlation**2)
        for i in np.flatnonzero(self.correlation):
            coloured[i] = self.correlation[i] * coloured[i - 1] + scale[i] * white[i]
        return coloured

    def slopes(self, model: Model, parameters: Floats, own: Floats, here: Predicted, *, fixed: bool = False) -> Slopes:
        """Return the derivatives of the whitened predictions by difference quotients.

        Parameters
        ----------
        model : Model
            The model.
        parameters : (p,) ndarray
            Shared parameters, SI.
        own : (R, k) ndarray
            Nuisance parameters.
        here : Predicted
            Prediction with these parameters.
        fixed : bool
            Whether the shared parameters are not fitted; their derivatives are then zeros.
        """
        shared = np.zeros((len(self.angle), len(parameters)))
        steps = STEP * np.maximum(model.scales, np.abs(parameters))
        # beyond a bound the model may be undefined: take the difference on the inner side
        steps = np.where(parameters + steps > model.upper, -steps, steps)
        for j in () if fixed else range(len(parameters)):
            unit = np.eye(len(parameters))[j]

            def shifted(by: float, unit: Floats = unit) -> Floats:
                return self.predict(model, parameters + by * unit, own).angle

            shared[:, j] = self._slope(shifted, here.angle, steps[j])
        columns = np.zeros((len(self.angle), own.shape[1]))
        for j in range(model.states):
            unit = np.eye(own.shape[1])[j]

            def started(by: float, unit: Floats = unit) -> Floats:
                return self.predict(model, parameters, own + by * unit, here.motion).angle

            columns[:, j] = self._slope(started, here.angle, NUISANCE_STEP)
        if self.zero_fitted.any():
            columns[:, -1] = self.zero_fitted[self.runs.owner]  # the prediction contains the zero as a summand
        return Slopes(self.whiten(shared), self.whiten(columns), self.runs.edges)

    def _slope(self, shifted: Callable[[float], Floats], here: Floats, step: float) -> Floats:
        """Return the (N,) difference quotient; near divergence the other side is taken, or zeros."""
        slope = (shifted(step) - here) / step
        wrong = [part for part in self.runs.parts if not np.isfinite(slope[part]).all()]
        if wrong:
            other = (shifted(-step) - here) / -step
            for part in wrong:
                slope[part] = other[part] if np.isfinite(other[part]).all() else 0.0
        return slope


def join(records: Sequence[Record], phi: float) -> Joined:
    """Join recordings.

    Parameters
    ----------
    records : sequence of Record
        At least one.
    phi : float
        AR(1) coefficient of the noise, frame to frame.
    """
    correlation = [np.append(0.0, phi ** (np.diff(r.time) / r.interval)) for r in records]
    return Joined(
        runs_of(records),
        np.concatenate([r.angle for r in records]),
        np.array([not r.zero_known for r in records]),
        np.concatenate(correlation) if phi else np.zeros(sum(len(c) for c in correlation)),
    )
