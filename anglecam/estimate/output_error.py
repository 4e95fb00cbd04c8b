"""Output error: the model runs freely, and its parameters are those whose angle is nearest to the measured one.

    minimise Σ_recordings |W(y − z − θ(t; p, x₀))|²  over p (shared) and x₀, z (each recording's own)

W whitens first-order autoregressive noise, so that a coloured residual is not counted as so many independent
observations. The initial state x₀ and, unless declared, the zero z of the angle are unknown in every recording.
Ljung, System Identification, 2nd ed., 1999, sec. 7.5.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, least_squares
from threadpoolctl import ThreadpoolController

from anglecam.effects import UNSEEN, View
from anglecam.estimate.record import Record
from anglecam.session import Command

Floats = NDArray[np.float64]

STEP = 1e-6
"""Of the difference quotients, as a share of a parameter."""
CLUSTER = 15
"""Frames; errors further apart than this count as independent."""
SETTLED = 1e-3
"""Log-likelihood; a fit that has gained no more by its last `PATIENCE` steps is as good as it will be. Along a ridge it
would crawl for many more, and where the angle has kinks one small step may come before a large one."""
PATIENCE = 3
HEAT, MOST = 8, 60
"""Evaluations that each of several starts is given before the best of them goes on, and that a fit may take."""
_BLAS = ThreadpoolController()
"""The matrices here have some twenty columns: threads that wait for each other made a fit ten times slower."""


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
        """(p,) standard uncertainties of ``parameters``, SI, NaN for a parameter that its bound holds.

        The larger of what noise that the whitening made white would give, and of what is left over itself gives if it
        may hang together within `CLUSTER` frames: a measurement's errors follow the motion, and so does what a model's
        equations round off (Liang and Zeger, Biometrika 73, 1986).
        """
        variance = np.maximum(np.diag(self.covariance), np.diag(self._covariance(self._clustered)))
        return np.sqrt(np.where(variance >= 0.0, variance, np.nan))

    @cached_property
    def covariance(self) -> Floats:
        """(p, p) covariance of ``parameters``, SI, likewise; NaN for a parameter that its bound holds."""
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

    def pulled_by_offset(self, records: Sequence[Record]) -> Floats:
        """Return (p,) by how much each parameter changes with an offset that all angles share, SI per rad.

        Nothing where zeros are fitted, which take it up; NaN for a parameter that its bound holds.
        """
        free, jacobian, norm = self._free_columns()
        ones = np.concatenate([whiten(r, self.phi, np.ones(len(r.time))) for r in records])
        change = np.linalg.lstsq(jacobian, ones, rcond=None)[0] / norm
        told = np.full(len(self.parameters), np.nan)
        told[free] = change[: int(free.sum())]
        return told

    def _free_columns(self) -> tuple[NDArray[np.bool_], Floats, Floats]:
        """Return which parameters no bound holds, and theirs and all own columns of the Jacobian over their norms."""
        p = len(self.parameters)
        margin = 1e-6 * self.model.scales
        free = (self.parameters > self.model.lower + margin) & (self.parameters < self.model.upper - margin)
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
        told = np.full((p, p), np.nan)  # a parameter held by its bound has none
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


def fit_output_error(
    model: Model,
    records: Sequence[Record],
    starts: Sequence[Floats],
    *,
    own: Sequence[Floats] | None = None,
    phi: float = 0.0,
    fixed: bool = False,
) -> Fit:
    """Fit a model to recordings by output error.

    Parameters
    ----------
    model : Model
        What to fit.
    records : sequence of Record
        All fitted at once.
    starts : sequence of (p,) ndarray
        Shared parameters to start from, SI; of several, only the one that is best after a few steps goes on.
    own : sequence of ndarray, optional
        Starts of each recording's own unknowns; from its first frames otherwise.
    phi : float
        Autocorrelation of the noise from frame to frame.
    fixed : bool
        Hold the shared parameters at ``starts[0]`` and fit only what is each recording's own: a prediction.

    Returns
    -------
    Fit
        The best of the starts.
    """
    own = [first_state(model, record) for record in records] if own is None else list(own)
    # a trial step may let the plant run away; its cost is then not finite and the step is refused
    with _BLAS.limit(limits=1, user_api="blas"), np.errstate(over="ignore", invalid="ignore"):
        start = starts[0]
        if len(starts) > 1:
            heats = [_fit_once(model, records, one, own, phi, fixed, HEAT) for one in starts]
            best = min(heats, key=lambda fit: fit.cost)
            start, own = best.parameters, list(best.own)
        return _fit_once(model, records, start, own, phi, fixed, MOST)


def predict_output_error(fit: Fit, records: Sequence[Record]) -> Fit:
    """Predict recordings in free run with the parameters of ``fit``; only initial states and zeros are fitted.

    They start from the first frames, and also from rest: with dry friction the two may end in different valleys.
    """
    moving = [first_state(fit.model, record) for record in records]
    resting = [np.concatenate([own[:1], np.zeros(fit.model.states - 1), own[fit.model.states :]]) for own in moving]
    fits = [
        fit_output_error(fit.model, records, [fit.parameters], own=own, phi=fit.phi, fixed=True)
        for own in (moving, resting)
    ]
    return min(fits, key=lambda one: one.cost)


def predicted_angle(model: Model, parameters: Floats, record: Record, own: Floats) -> Floats:
    """Return the (n,) angle, rad, that a model gives a recording from its own unknowns ``own``."""
    zero = 0.0 if record.zero_known else own[model.states]
    return zero + model.predict(parameters, record.time, record.command, own[: model.states], record.view)


def output_error(
    model: Model, parameters: Floats, records: Sequence[Record], own: Sequence[Floats], phi: float
) -> float:
    """Return the sum of squared whitened residuals, rad², of a model as it stands; infinite where it runs away."""
    with np.errstate(over="ignore", invalid="ignore"):
        left = [
            whiten(r, phi, r.angle - predicted_angle(model, parameters, r, o))
            for r, o in zip(records, own, strict=True)
        ]
        cost = float(sum(one @ one for one in left))
    return cost if np.isfinite(cost) else np.inf


def _fit_once(
    model: Model, records: Sequence[Record], start: Floats, own: Sequence[Floats], phi: float, fixed: bool, most: int
) -> Fit:
    start = np.clip(start, model.lower, model.upper)
    p = len(start)
    edges = np.cumsum([p, *(len(o) for o in own)])
    rows = np.cumsum([0, *(len(r.time) for r in records)])
    shared = [] if fixed else list(range(p))

    def split(x: Floats) -> tuple[Floats, list[Floats]]:
        return x[:p], [x[edges[i] : edges[i + 1]] for i in range(len(records))]

    latest: dict[bytes, list[Floats]] = {}

    def predicted(x: Floats) -> list[Floats]:
        """Predict all recordings; the Jacobian is asked for where the errors just were."""
        if x.tobytes() not in latest:
            parameters, unknowns = split(x)
            latest.clear()
            latest[x.tobytes()] = [
                predicted_angle(model, parameters, r, o) for r, o in zip(records, unknowns, strict=True)
            ]
        return latest[x.tobytes()]

    def errors(x: Floats) -> Floats:
        parts = [whiten(r, phi, r.angle - p) for r, p in zip(records, predicted(x), strict=True)]
        return np.concatenate(parts)

    def jacobian(x: Floats) -> Floats:
        parameters, unknowns = split(x)
        result = np.zeros((rows[-1], len(x)))
        for i, (record, o, here) in enumerate(zip(records, unknowns, predicted(x), strict=True)):
            both = np.concatenate([parameters, o])
            steps = STEP * np.concatenate([np.maximum(model.scales, np.abs(parameters)), np.full(len(o), 0.1)])
            columns = [*shared, *range(p, p + len(o))]
            place = [*shared, *range(edges[i], edges[i + 1])]
            block = np.empty((len(record.time), len(columns)))
            for k, j in enumerate(columns):
                if j == p + model.states:  # the zero is added as it is
                    block[:, k] = 1.0
                    continue
                # a bound may be a wall of the physics: difference on its inner side there
                step = -steps[j] if j < p and both[j] + steps[j] > model.upper[j] else steps[j]
                beside = both.copy()
                beside[j] += step
                block[:, k] = (predicted_angle(model, beside[:p], record, beside[p:]) - here) / step
            result[rows[i] : rows[i + 1], place] = -whiten(record, phi, block)
        return result

    x0 = np.concatenate([start, *own])
    free = np.array([*shared, *range(p, len(x0))])
    lower, upper = np.full(len(x0), -np.inf), np.full(len(x0), np.inf)
    lower[:p], upper[:p] = model.lower, model.upper

    def whole(x: Floats) -> Floats:
        full = x0.copy()
        full[free] = x
        return full

    def ended(x: Floats, white: Floats, slopes: Floats) -> Fit:
        parameters, unknowns = split(x)
        left = tuple(r.angle - here for r, here in zip(records, predicted(x), strict=True))
        return Fit(model, parameters, tuple(unknowns), left, slopes, phi, white)

    inside = np.clip(x0, np.nextafter(lower, np.inf), np.nextafter(upper, -np.inf))
    costs = [0.5 * float(np.sum(errors(inside) ** 2))]
    if not math.isfinite(costs[0]):
        return ended(x0, np.full(rows[-1], np.inf), np.zeros((rows[-1], len(x0))))

    def settled(intermediate_result: OptimizeResult) -> None:
        costs.append(intermediate_result.cost)
        if len(costs) > PATIENCE and costs[-1 - PATIENCE] - costs[-1] <= 2.0 * SETTLED / rows[-1] * costs[-1]:
            raise StopIteration

    found = least_squares(
        lambda x: errors(whole(x)),
        inside[free],
        jac=lambda x: jacobian(whole(x))[:, free],
        bounds=(lower[free], upper[free]),
        x_scale="jac",
        xtol=1e-9,
        ftol=1e-9,
        gtol=1e-12,
        max_nfev=most,
        callback=settled,
    )
    slopes = np.zeros((rows[-1], len(x0)))
    slopes[:, free] = -found.jac
    return ended(whole(found.x), found.fun, slopes)


def first_state(model: Model, record: Record) -> Floats:
    """Start a recording's own unknowns at its first angle, and at rest if its command has held it there.

    One that begins in motion starts with its first rate: at rest a plant with dry friction may be stuck, where nothing
    tells which way it should move.
    """
    change = None if record.command is None else record.command.first_change()
    resting = change is not None and change >= record.time[0]
    few = slice(0, min(5, len(record.time)))
    rate, angle = np.polyfit(record.time[few] - record.time[0], record.angle[few], 2)[1:]
    state = np.zeros(model.states)
    state[:2] = (record.angle[0], 0.0) if resting else (angle, rate)
    return state if record.zero_known else np.append(state, 0.0)
