"""A fitted model: its parameters, its residuals, and the uncertainty of its parameters.

Residuals are whitened as first-order autoregressive noise, so that correlated residuals do not count as as many
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
from anglecam.identification.noise import RESIDUAL, autoregression
from anglecam.identification.slopes import Slopes
from anglecam.models.model import Model

CLUSTER_FRAMES = 15
"""Frames in a cluster of the cluster-robust covariance; errors further apart count as independent."""
NARROW = 1e-4
"""Standard deviations between two bounds within which a normal distribution is uniform; at `FARTHEST_BEYOND_BOUND`
from its mean its density changes by 1 % over them."""
FARTHEST_BEYOND_BOUND = 100.0
"""Standard deviations. The mean of a parameter that would lie further beyond its bound is moved to this distance, at
which the parameter is practically known to be on the bound."""


@dataclass(frozen=True)
class Fit:
    """A fitted model."""

    model: Model
    parameters: Floats
    """(p,) shared parameters, SI, in the order of ``model.names``."""
    nuisance: tuple[Floats, ...] = field(repr=False)
    """Nuisance parameters of each recording: initial states, then the zero (rad) unless it is declared."""
    residuals: tuple[Floats, ...] = field(repr=False)
    """Measured minus predicted angle of each recording, rad."""
    slopes: Slopes = field(repr=False)
    """Derivatives of the whitened predictions, not divided by σ."""
    phi: float
    """AR(1) coefficient, frame to frame, of the noise model that the fit was whitened with."""
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
        return autoregression(self.residuals, RESIDUAL).phi

    @cached_property
    def sigma(self) -> Floats:
        """(p,) standard uncertainties of ``parameters``, SI; NaN at a bound and for a parameter without effect.

        The larger of two estimates. The first takes the whitened residuals for white noise. The second is
        cluster-robust: residuals may be correlated within `CLUSTER_FRAMES` frames, because errors of a measurement and
        of a simplified model follow the motion (Liang and Zeger, Biometrika 73, 1986). A parameter at a bound is not
        known to be there: the uncertainties of the others include its possible distance from the bound.
        """
        variance = np.maximum(np.diag(self.covariance), np.diag(self._covariance(self._clustered)))
        return np.sqrt(np.where(variance >= 0.0, variance, np.nan))

    @cached_property
    def covariance(self) -> Floats:
        """(p, p) covariance of ``parameters`` for white residuals, SI; NaN for a parameter not determined."""
        return self._covariance(lambda jacobian: jacobian)

    def autoregressive_covariance(self, records: Sequence[Record], phi: float) -> Floats:
        """Return `covariance` for a fit without whitening whose noise is AR(1) with coefficient φ = ``phi``.

        The covariance is the sandwich (JᵀJ)⁻¹ JᵀRJ (JᵀJ)⁻¹, where R is the correlation matrix of the noise.
        """

        def correlate(jacobian: Floats) -> Floats:
            edges = np.cumsum([0, *(len(r.time) for r in records)])
            parts = zip(records, pairwise(edges), strict=True)
            return np.concatenate([_correlate(r, phi, jacobian[i:j]) for r, (i, j) in parts])

        return self._covariance(correlate)

    def _clustered(self, jacobian: Floats) -> Floats:
        """Multiply (N, k) values by the residuals' covariance within clusters, in units of their variance."""
        if self._variance == 0.0:
            return jacobian
        edges = np.cumsum([0, *(len(e) for e in self.residuals)])
        parts = [
            slice(i, min(i + CLUSTER_FRAMES, stop))
            for start, stop in pairwise(edges)
            for i in range(start, stop, CLUSTER_FRAMES)
        ]
        product = [np.outer(self.white[part], self.white[part] @ jacobian[part]) for part in parts]
        return np.concatenate(product) / self._variance * len(parts) / max(1, len(parts) - 1)

    def parameter_shift(self, records: Sequence[Record], errors: Sequence[Floats]) -> Floats:
        """Return the (p,) shift of each parameter, SI, that errors of the angles cause, to first order.

        Parameters
        ----------
        records : sequence of Record
            The fitted recordings.
        errors : sequence of (n,) ndarray
            Errors of the angles, rad, one array for each recording.

        Returns
        -------
        (p,) ndarray
            SI. Errors that fitted zeros and initial states absorb cause no shift. NaN for a parameter that cannot be
            determined.
        """
        free = self._sensitive & ~self._at_bound
        jacobian, norm = self._scaled(free)
        white = np.concatenate([whiten(r, self.phi, error) for r, error in zip(records, errors, strict=True)])
        shift = np.full(len(self.parameters), np.nan)
        shift[free] = np.linalg.lstsq(jacobian, white, rcond=None)[0] / norm
        return shift

    @property
    def _at_bound(self) -> NDArray[np.bool_]:
        """(p,) whether each parameter is at one of its bounds."""
        margin = 1e-6 * self.model.scales
        return (self.parameters <= self.model.lower + margin) | (self.parameters >= self.model.upper - margin)

    @property
    def _sensitive(self) -> NDArray[np.bool_]:
        """(p,) whether the prediction changes with each parameter in a way that no nuisance parameter can follow.

        Stiction is an event: the joint either breaks away or stays stuck, so a small change of a break-away level may
        change nothing.
        """
        return np.linalg.norm(self.slopes.projected, axis=0) > 0.0

    def _scaled(self, which: NDArray[np.bool_]) -> tuple[Floats, Floats]:
        """Return the projected derivatives with respect to some shared parameters, normalised, and the norms."""
        columns = self.slopes.projected[:, which]
        norm = np.linalg.norm(columns, axis=0)
        return columns / norm, norm

    @property
    def _variance(self) -> float:
        """Variance of the whitened residuals, rad²."""
        return self.cost / max(1, len(self.white) - self.slopes.rank)

    def _covariance(self, correlate: Callable[[Floats], Floats]) -> Floats:
        sensitive, at_bound = self._sensitive, self._at_bound
        jacobian, norm = self._scaled(sensitive)
        bread = np.linalg.pinv(jacobian.T @ jacobian)
        covariance = self._variance * bread @ (jacobian.T @ correlate(jacobian)) @ bread / np.outer(norm, norm)
        if (sensitive & at_bound).any():
            step = bread @ (jacobian.T @ self.white) / norm
            lower, upper = self.model.lower - self.parameters, self.model.upper - self.parameters
            within = [(at, lower[i], upper[i]) for at, i in enumerate(np.flatnonzero(sensitive)) if at_bound[i]]
            covariance = _truncated(step, covariance, within)
        result = np.full((len(sensitive), len(sensitive)), np.nan)
        free, rows = sensitive & ~at_bound, np.flatnonzero(~at_bound[sensitive])
        result[np.ix_(free, free)] = covariance[np.ix_(rows, rows)]
        return result


def _truncated(step: Floats, covariance: Floats, within: Sequence[tuple[int, float, float]]) -> Floats:
    """Return the (k, k) second moments about an estimate of variables some of which are at a bound.

    Without bounds the variables would be normal about the estimate plus ``step``. The distribution of each variable in
    ``within`` (position, lower and upper bound as distances from the estimate) is truncated at its bounds, and the
    variables correlated with it are updated. Treating a variable on its bound as known would make the others appear
    more certain than they are. The variables are truncated one after another, the rest taken as normal (Simon and
    Simon, Int. J. Syst. Sci. 41, 2010).
    """
    from scipy.stats import truncnorm  # takes most of a second to load: only for parameters at bounds

    for at, lower, upper in within:
        sd = np.sqrt(covariance[at, at])
        if not sd > 0.0:
            continue
        mean = np.clip(step[at], lower - FARTHEST_BEYOND_BOUND * sd, upper + FARTHEST_BEYOND_BOUND * sd)
        if upper - lower < NARROW * sd:
            mean_within, variance_within = 0.5 * (lower + upper), (upper - lower) ** 2 / 12.0
        else:
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
        Its frame times count: over a gap of k frames the correlation is φᵏ.
    phi : float
        AR(1) coefficient, frame to frame, 0 ≤ φ < 1.
    values : (n,) or (n, k) ndarray
        Values to whiten, along the first axis.

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
    """Multiply (n, k) values by the correlation matrix of AR(1) noise, in one forward and one backward pass."""
    step = phi ** (np.diff(record.time) / record.interval)
    forwards, backwards = values.copy(), values.copy()
    for i in range(1, len(values)):
        forwards[i] += step[i - 1] * forwards[i - 1]
        backwards[-1 - i] += step[-i] * backwards[-i]
    return forwards + backwards - values
