"""A fitted model: its parameters, what it leaves over, and how sure its parameters are.

What is left over is whitened as first-order autoregressive noise, so that a coloured residual does not count as so many
independent observations. Ljung, System Identification, 2nd ed., 1999, sec. 9.4.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from anglecam.data.record import Record
from anglecam.data.typing import Floats
from anglecam.identification.noise import autoregression
from anglecam.models.model import Model

CLUSTER_FRAMES = 15
"""Frames; errors further apart than this count as independent."""
FARTHEST_BEYOND_BOUND = 100.0
"""Standard deviations; a parameter that would lie further beyond its bound is as good as known to be on it."""


@dataclass(frozen=True)
class Fit:
    """A fitted model."""

    model: Model
    parameters: Floats
    """(p,) shared parameters, SI, in the order of ``model.names``."""
    nuisance: tuple[Floats, ...] = field(repr=False)
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

    @property
    def residual_phi(self) -> float:
        """AR(1) coefficient, frame to frame, of the residuals."""
        return autoregression(self.residuals, "residual").phi

    @cached_property
    def sigma(self) -> Floats:
        """(p,) standard uncertainties of ``parameters``, SI; NaN for one that a bound holds or that moves nothing.

        The larger of what noise that the whitening made white would give, and of what is left over itself gives if it
        may hang together within `CLUSTER_FRAMES` frames: a measurement's errors follow the motion, and so does what a model's
        equations round off (Liang and Zeger, Biometrika 73, 1986). What a bound holds is not known to be there: the
        others are as unsure as it may be off the bound.
        """
        variance = np.maximum(np.diag(self.covariance), np.diag(self._covariance(self._clustered)))
        return np.sqrt(np.where(variance >= 0.0, variance, np.nan))

    @cached_property
    def covariance(self) -> Floats:
        """(p, p) covariance of ``parameters``, SI, likewise; NaN for a parameter that cannot be told."""
        return self._covariance(lambda jacobian: jacobian)

    def autoregressive_covariance(self, records: Sequence[Record], phi: float) -> Floats:
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
            slice(i, min(i + CLUSTER_FRAMES, stop))
            for start, stop in pairwise(edges)
            for i in range(start, stop, CLUSTER_FRAMES)
        ]
        variance = self.cost / max(1, len(self.white) - jacobian.shape[1])
        product = [np.outer(self.white[part], self.white[part] @ jacobian[part]) for part in parts]
        return np.concatenate(product) / variance * len(parts) / max(1, len(parts) - 1)

    def parameter_shift(self, records: Sequence[Record], errors: Sequence[Floats]) -> Floats:
        """Return (p,) by how much each parameter changes, SI, with errors of the angles (rad, one array a recording).

        Nothing for what zeros and initial states that are fitted take up; NaN for a parameter that cannot be told.
        """
        free = self._felt & ~self._held
        jacobian, norm = self._scaled(free)
        white = np.concatenate([whiten(r, self.phi, error) for r, error in zip(records, errors, strict=True)])
        change = np.linalg.lstsq(jacobian, white, rcond=None)[0] / norm
        told = np.full(len(self.parameters), np.nan)
        told[free] = change[: int(free.sum())]
        return told

    @property
    def _held(self) -> NDArray[np.bool_]:
        """(p,) whether a bound holds each parameter."""
        margin = 1e-6 * self.model.scales
        return (self.parameters <= self.model.lower + margin) | (self.parameters >= self.model.upper - margin)

    @property
    def _felt(self) -> NDArray[np.bool_]:
        """(p,) whether a little more of each parameter moves anything: of what lets go or does not, it does not."""
        return np.linalg.norm(self.jacobian[:, : len(self.parameters)], axis=0) > 0.0

    def _scaled(self, which: NDArray[np.bool_]) -> tuple[Floats, Floats]:
        """Return the Jacobian's columns of some parameters and of all that is own, over their norms, and the norms."""
        columns = np.concatenate([which, np.ones(self.jacobian.shape[1] - len(which), bool)])
        norm = np.linalg.norm(self.jacobian[:, columns], axis=0)
        norm[norm == 0.0] = 1.0
        return self.jacobian[:, columns] / norm, norm

    def _covariance(self, correlate: Callable[[Floats], Floats]) -> Floats:
        felt, held = self._felt, self._held
        jacobian, norm = self._scaled(felt)
        variance = self.cost / max(1, len(self.white) - jacobian.shape[1])
        bread = np.linalg.pinv(jacobian.T @ jacobian)
        covariance = variance * bread @ (jacobian.T @ correlate(jacobian)) @ bread / np.outer(norm, norm)
        if (felt & held).any():
            step = bread @ (jacobian.T @ self.white) / norm
            lower, upper = self.model.lower - self.parameters, self.model.upper - self.parameters
            within = [(at, lower[i], upper[i]) for at, i in enumerate(np.flatnonzero(felt)) if held[i]]
            covariance = _confined(step, covariance, within)
        told = np.full((len(felt), len(felt)), np.nan)  # a parameter that cannot be told has none
        free, rows = felt & ~held, np.flatnonzero(~held[felt])
        told[np.ix_(free, free)] = covariance[np.ix_(rows, rows)]
        return told


def _confined(step: Floats, covariance: Floats, within: Sequence[tuple[int, float, float]]) -> Floats:
    """Return the second moments about an estimate some of whose variables bounds hold.

    Without bounds the variables would be normal about the estimate plus ``step``. Each in ``within`` is cut off at its
    bounds, and all that hang together with it follow: on the bound they would count as known, and the others as surer
    than they are. One after another, the rest taken as normal (Simon and Simon, Int. J. Syst. Sci. 41, 2010).
    """
    from scipy.stats import truncnorm  # takes most of a second to load, which who has nothing on a bound is spared

    for at, lower, upper in within:
        sd = np.sqrt(covariance[at, at])
        if not sd > 0.0:
            continue
        mean = np.clip(step[at], lower - FARTHEST_BEYOND_BOUND * sd, upper + FARTHEST_BEYOND_BOUND * sd)
        mean_within, variance_within = truncnorm.stats((lower - mean) / sd, (upper - mean) / sd, mean, sd)
        slope = covariance[at] / sd**2
        step = step + slope * (mean_within - step[at])
        covariance = covariance - np.outer(slope, slope) * (sd**2 - variance_within)
    return covariance + np.outer(step, step)


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
