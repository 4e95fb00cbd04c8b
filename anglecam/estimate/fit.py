"""A fitted model: its parameters, what it leaves over, and how sure its parameters are.

What is left over is whitened as first-order autoregressive noise, so that a coloured residual does not count as so many
independent observations. Ljung, System Identification, 2nd ed., 1999, sec. 9.4.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from anglecam.effects import UNSEEN, View
from anglecam.estimate.record import Record
from anglecam.session import Command

Floats = NDArray[np.float64]

CLUSTER = 15
"""Frames; errors further apart than this count as independent."""


class Model(Protocol):
    """What can be fitted: `anglecam.simulate.plant.Plant` and `anglecam.simulate.third_order.ThirdOrder`."""

    states: int

    @property
    def names(self) -> tuple[str, ...]: ...  # noqa: D102  # documented where implemented
    @property
    def lower(self) -> Floats: ...  # noqa: D102
    @property
    def upper(self) -> Floats: ...  # noqa: D102
    @property
    def scales(self) -> Floats: ...  # noqa: D102
    @property
    def to_file(self) -> Floats: ...  # noqa: D102
    def predict(  # noqa: D102
        self, parameters: Floats, time: Floats, command: Command | None, state: Floats, view: View = UNSEEN
    ) -> Floats: ...


@dataclass(frozen=True)
class Fit:
    """A fitted model."""

    model: Model
    parameters: Floats
    """(p,) shared parameters, SI, in the order of ``model.names``."""
    own: tuple[Floats, ...] = field(repr=False)
    """Each recording's own unknowns: initial states, then the zero (rad) unless declared."""
    residuals: tuple[Floats, ...] = field(repr=False)
    """Measured minus predicted angle of each recording, rad."""
    jacobian: Floats = field(repr=False)
    """(N, p + Σ own) derivative of the whitened predictions, 1/σ left out."""
    phi: float
    """Autocorrelation of the noise from frame to frame that the fit was whitened with."""
    white: Floats = field(repr=False)
    """(N,) whitened residuals of all recordings, rad."""

    @property
    def rmse(self) -> float:
        """Root mean square residual, rad."""
        return float(np.sqrt(np.mean(np.concatenate(self.residuals) ** 2)))

    @property
    def cost(self) -> float:
        """Sum of squared whitened residuals, rad²."""
        return float(self.white @ self.white)

    @cached_property
    def sigma(self) -> Floats:
        """(p,) standard uncertainties of ``parameters``, SI; NaN for one that a bound holds or that moves nothing.

        The larger of what noise that the whitening made white would give, and of what is left over itself gives if it
        may hang together within `CLUSTER` frames: a measurement's errors follow the motion, and so does what a model's
        equations round off (Liang and Zeger, Biometrika 73, 1986).
        """
        variance = np.maximum(np.diag(self.covariance), np.diag(self._covariance(self._clustered)))
        return np.sqrt(np.where(variance >= 0.0, variance, np.nan))

    @cached_property
    def covariance(self) -> Floats:
        """(p, p) covariance of ``parameters``, SI, likewise; NaN for a parameter that cannot be told."""
        return self._covariance(lambda jacobian: jacobian)

    def coloured_covariance(self, records: Sequence[Record], phi: float) -> Floats:
        """Return `covariance` for a fit without whitening whose noise is nevertheless AR(1) with φ = ``phi``.

        The covariance is the sandwich (JᵀJ)⁻¹ JᵀRJ (JᵀJ)⁻¹, R the correlation of the noise.
        """

        def correlate(jacobian: Floats) -> Floats:
            edges = np.cumsum([0, *(len(r.time) for r in records)])
            parts = zip(records, pairwise(edges), strict=True)
            return np.concatenate([_correlate(r, phi, jacobian[i:j]) for r, (i, j) in parts])

        return self._covariance(correlate)

    def _clustered(self, jacobian: Floats) -> Floats:
        """Multiply (N, k) values by the errors' covariance as clusters of the residuals tell it, in variances."""
        edges = np.cumsum([0, *(len(e) for e in self.residuals)])
        parts = [
            slice(i, min(i + CLUSTER, stop)) for start, stop in pairwise(edges) for i in range(start, stop, CLUSTER)
        ]
        variance = self.cost / max(1, len(self.white) - jacobian.shape[1])
        product = [np.outer(self.white[part], self.white[part] @ jacobian[part]) for part in parts]
        return np.concatenate(product) / variance * len(parts) / max(1, len(parts) - 1)

    def pulled_by(self, records: Sequence[Record], errors: Sequence[Floats]) -> Floats:
        """Return (p,) by how much each parameter changes, SI, with errors of the angles (rad, one array a recording).

        Nothing for what zeros and initial states that are fitted take up; NaN for a parameter that cannot be told.
        """
        free, jacobian, norm = self._free_columns()
        white = np.concatenate([whiten(r, self.phi, error) for r, error in zip(records, errors, strict=True)])
        change = np.linalg.lstsq(jacobian, white, rcond=None)[0] / norm
        told = np.full(len(self.parameters), np.nan)
        told[free] = change[: int(free.sum())]
        return told

    def _free_columns(self) -> tuple[NDArray[np.bool_], Floats, Floats]:
        """Return which parameters can be told, and theirs and all own columns of the Jacobian over their norms."""
        p = len(self.parameters)
        margin = 1e-6 * self.model.scales
        free = (self.parameters > self.model.lower + margin) & (self.parameters < self.model.upper - margin)
        # what lets go or does not moves nothing if it is a little more or less
        free &= np.linalg.norm(self.jacobian[:, :p], axis=0) > 0.0
        columns = np.concatenate([free, np.ones(self.jacobian.shape[1] - p, bool)])
        norm = np.linalg.norm(self.jacobian[:, columns], axis=0)
        norm[norm == 0.0] = 1.0
        return free, self.jacobian[:, columns] / norm, norm

    def _covariance(self, correlate: Callable[[Floats], Floats]) -> Floats:
        free, jacobian, norm = self._free_columns()
        p, n = len(free), int(free.sum())
        variance = self.cost / max(1, len(self.white) - jacobian.shape[1])
        bread = np.linalg.pinv(jacobian.T @ jacobian)
        covariance = variance * bread @ (jacobian.T @ correlate(jacobian)) @ bread
        covariance /= np.outer(norm, norm)
        told = np.full((p, p), np.nan)  # a parameter that cannot be told has none
        told[np.ix_(free, free)] = covariance[:n, :n]
        return told


def whiten(record: Record, phi: float, values: Floats) -> Floats:
    """Turn first-order autoregressive noise into white noise of the same variance.

    Parameters
    ----------
    record : Record
        For the frame times: over a gap of k frames the correlation is φᵏ.
    phi : float
        Correlation from frame to frame, 0 ≤ φ < 1.
    values : (n,) or (n, k) ndarray
        What to whiten, along the first axis.

    Returns
    -------
    (n,) or (n, k) ndarray
        e₁, (eᵢ − φᵏeᵢ₋₁)/√(1 − φ²ᵏ).
    """
    if phi == 0.0:
        return values
    step = phi ** (np.diff(record.time) / record.interval)
    scale = 1.0 / np.sqrt(1.0 - step**2)
    if values.ndim == 2:
        step, scale = step[:, None], scale[:, None]
    return np.concatenate([values[:1], (values[1:] - step * values[:-1]) * scale])


def _correlate(record: Record, phi: float, values: Floats) -> Floats:
    """Multiply (n, k) values by the correlation matrix of AR(1) noise, by one pass forwards and one backwards."""
    step = phi ** (np.diff(record.time) / record.interval)
    forwards, backwards = values.copy(), values.copy()
    for i in range(1, len(values)):
        forwards[i] += step[i - 1] * forwards[i - 1]
        backwards[-1 - i] += step[-i] * backwards[-i]
    return forwards + backwards - values
