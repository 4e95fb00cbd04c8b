"""Output error: the parameters minimise the difference between the measured angle and that of a free run.

    minimise Σ_recordings |W(y − z − θ(t; p, x₀))|²  over p (shared) and x₀, z (each recording's nuisance)

W whitens first-order autoregressive noise, so that correlated residuals do not count as as many independent
observations. The initial state x₀ and, unless declared, the zero z of the angle are unknown in every recording.
Ljung, System Identification, 2nd ed., 1999, sec. 7.5.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.optimize import OptimizeResult, least_squares
from threadpoolctl import ThreadpoolController

from anglecam.data.record import Record
from anglecam.data.typing import Floats
from anglecam.identification.fit import Fit
from anglecam.identification.joined import Joined, Predicted, join
from anglecam.models.model import Model

SETTLED = 1e-3
"""Log-likelihood; a fit ends when its last `PATIENCE` steps have gained no more than this. Along a ridge it would
otherwise continue with many tiny steps."""
PATIENCE = 3
"""Steps; with a kinked prediction one small step may precede a large one, so a single small step does not end a fit."""
TRIAL_EVALUATIONS = 8
"""Evaluations of each of several starts before only the best of them is continued."""
MAX_EVALUATIONS = 60
"""Most evaluations of a fit."""
_BLAS = ThreadpoolController()
"""Limits BLAS to one thread. The matrices have some twenty columns, and waiting threads made a fit ten times slower."""


def fit_output_error(
    model: Model,
    records: Sequence[Record],
    starts: Sequence[Floats],
    *,
    nuisance: Sequence[Floats] | None = None,
    phi: float = 0.0,
    fixed: bool = False,
) -> Fit:
    """Fit a model to recordings by output error.

    Parameters
    ----------
    model : Model
        Model to fit.
    records : sequence of Record
        Recordings, all fitted at once.
    starts : sequence of (p,) ndarray
        Starting values of the shared parameters, SI; the best result is kept.
    nuisance : sequence of ndarray, optional
        Starting values of each recording's nuisance parameters; from its first frames otherwise.
    phi : float
        AR(1) coefficient of the noise, frame to frame.
    fixed : bool
        Hold the shared parameters at ``starts[0]`` and fit only the nuisance parameters: a prediction.

    Returns
    -------
    Fit
        The best result of all starts.
    """
    nuisance = [first_state(model, record) for record in records] if nuisance is None else nuisance
    return min(_fit_all(model, records, starts, nuisance, phi, fixed, MAX_EVALUATIONS), key=lambda fit: fit.cost)


def fit_best_start(
    model: Model, records: Sequence[Record], starts: Sequence[Floats], nuisance: Sequence[Floats], phi: float
) -> Fit:
    """Fit as `fit_output_error` does, but continue only the start that is best after a few steps.

    For models whose fits are slow; a few steps find the deepest minimum almost as reliably.
    """
    trials = _fit_all(model, records, starts, nuisance, phi, False, TRIAL_EVALUATIONS)
    best = min(trials, key=lambda fit: fit.cost)
    return fit_output_error(model, records, [best.parameters], nuisance=best.nuisance, phi=phi)


def _fit_all(
    model: Model,
    records: Sequence[Record],
    starts: Sequence[Floats],
    nuisance: Sequence[Floats],
    phi: float,
    fixed: bool,
    most: int,
) -> list[Fit]:
    joined = join(records, phi)
    # a trial step may make the plant diverge; its cost is then not finite and the step is rejected
    with _BLAS.limit(limits=1, user_api="blas"), np.errstate(over="ignore", invalid="ignore"):
        return [_fit_once(model, joined, start, nuisance, phi, fixed, most) for start in starts]


def predict_output_error(fit: Fit, records: Sequence[Record]) -> Fit:
    """Predict recordings in free run with the parameters of ``fit``; only initial states and zeros are fitted.

    Two fits start from the rates of the first frames and from rest: with dry friction they may end in different minima.
    """
    moving = [first_state(fit.model, record) for record in records]
    resting = [
        np.concatenate([nuisance[:1], np.zeros(fit.model.states - 1), nuisance[fit.model.states :]])
        for nuisance in moving
    ]
    fits = [
        fit_output_error(fit.model, records, [fit.parameters], nuisance=nuisance, phi=fit.phi, fixed=True)
        for nuisance in (moving, resting)
    ]
    return min(fits, key=lambda one: one.cost)


def output_error(
    model: Model, parameters: Floats, records: Sequence[Record], nuisance: Sequence[Floats], phi: float
) -> float:
    """Return the sum of squared whitened residuals, rad², at given parameters; infinite if the model diverges."""
    joined = join(records, phi)
    with np.errstate(over="ignore", invalid="ignore"):
        white = joined.errors(joined.predict(model, parameters, joined.stack(nuisance)))
        cost = float(white @ white)
    return cost if np.isfinite(cost) else np.inf


def _fit_once(
    model: Model, joined: Joined, start: Floats, nuisance: Sequence[Floats], phi: float, fixed: bool, most: int
) -> Fit:
    start = np.clip(start, model.lower, model.upper)
    p, rows = len(start), len(joined.angle)
    unknown = joined.fitted(joined.stack(nuisance))
    x0 = np.concatenate([start, *nuisance])
    latest: dict[bytes, Predicted] = {}

    def split(x: Floats) -> tuple[Floats, Floats]:
        own = np.zeros(unknown.shape)
        own[unknown] = x[p:]
        return x[:p], own

    def predicted(x: Floats) -> Predicted:
        """Predict all recordings; the last result is kept, as the Jacobian follows the errors at the same point."""
        if x.tobytes() not in latest:
            latest.clear()
            latest[x.tobytes()] = joined.predict(model, *split(x))
        return latest[x.tobytes()]

    def errors(x: Floats) -> Floats:
        return joined.errors(predicted(x))

    def jacobian(x: Floats) -> Floats:
        return -joined.dense(joined.slopes(model, *split(x), predicted(x), fixed=fixed))

    free = np.arange(p if fixed else 0, len(x0))
    lower, upper = np.full(len(x0), -np.inf), np.full(len(x0), np.inf)
    lower[:p], upper[:p] = model.lower, model.upper

    def full(x: Floats) -> Floats:
        unknowns = x0.copy()
        unknowns[free] = x
        return unknowns

    def fit_at(x: Floats, white: Floats, slopes: Floats) -> Fit:
        parameters, own = split(x)
        residuals = tuple(joined.runs.split(joined.angle - predicted(x).angle))
        fitted = tuple(one[which] for one, which in zip(own, unknown, strict=True))
        return Fit(model, parameters, fitted, residuals, slopes, phi, white)

    inside = np.clip(x0, np.nextafter(lower, np.inf), np.nextafter(upper, -np.inf))
    costs = [0.5 * float(np.sum(errors(inside) ** 2))]
    if not math.isfinite(costs[0]):
        return fit_at(x0, np.full(rows, np.inf), np.zeros((rows, len(x0))))

    def settled(intermediate_result: OptimizeResult) -> None:
        costs.append(intermediate_result.cost)
        if len(costs) > PATIENCE and costs[-1 - PATIENCE] - costs[-1] <= 2.0 * SETTLED / rows * costs[-1]:
            raise StopIteration

    found = least_squares(
        lambda x: errors(full(x)),
        inside[free],
        jac=lambda x: jacobian(full(x))[:, free],
        bounds=(lower[free], upper[free]),
        x_scale="jac",
        xtol=1e-9,
        ftol=1e-9,
        gtol=1e-12,
        max_nfev=most,
        callback=settled,
    )
    slopes = np.zeros((rows, len(x0)))
    slopes[:, free] = -found.jac
    return fit_at(full(found.x), found.fun, slopes)


def first_state(model: Model, record: Record) -> Floats:
    """Return starting values of a recording's nuisance parameters: its first angle, at rest before the first command.

    A recording that begins in motion starts with its first rate: from rest a plant with dry friction may be stuck, and
    the cost then does not depend on the direction in which it should move.
    """
    change = None if record.command is None else record.command.first_change()
    resting = change is not None and change >= record.time[0]
    few = slice(0, min(5, len(record.time)))
    rate, angle = np.polyfit(record.time[few] - record.time[0], record.angle[few], 2)[1:]
    state = np.zeros(model.states)
    state[:2] = (record.angle[0], 0.0) if resting else (angle, rate)
    return state if record.zero_known else np.append(state, 0.0)
