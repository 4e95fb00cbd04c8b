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
from anglecam.identification.fit import Fit, whiten
from anglecam.models.model import Model

STEP = 1e-6
"""Step of the difference quotients, as a share of a parameter's magnitude."""
SETTLED = 1e-3
"""Log-likelihood; a fit ends when its last `PATIENCE` steps have gained no more than this. Along a ridge it would
otherwise continue with many tiny steps."""
PATIENCE = 3
"""Steps; with a kinked prediction one small step may precede a large one, so a single small step does not end a fit."""
RUNAWAY = 1e100
"""rad; a larger angle counts as divergence: the squares of its derivatives would soon overflow."""
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
    # a trial step may make the plant diverge; its cost is then not finite and the step is rejected
    with _BLAS.limit(limits=1, user_api="blas"), np.errstate(over="ignore", invalid="ignore"):
        return [_fit_once(model, records, start, nuisance, phi, fixed, most) for start in starts]


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


def predicted_angle(model: Model, parameters: Floats, record: Record, nuisance: Floats) -> Floats:
    """Return the (n,) angle, rad, that a model predicts for a recording; NaN where it diverges."""
    zero = 0.0 if record.zero_known else nuisance[model.states]
    angle = zero + model.predict(parameters, record.time, record.command, nuisance[: model.states], record.view)
    return np.where(np.abs(angle) < RUNAWAY, angle, np.nan)


def output_error(
    model: Model, parameters: Floats, records: Sequence[Record], nuisance: Sequence[Floats], phi: float
) -> float:
    """Return the sum of squared whitened residuals, rad², at given parameters; infinite if the model diverges."""
    with np.errstate(over="ignore", invalid="ignore"):
        residuals = [
            whiten(r, phi, r.angle - predicted_angle(model, parameters, r, o))
            for r, o in zip(records, nuisance, strict=True)
        ]
        cost = float(sum(one @ one for one in residuals))
    return cost if np.isfinite(cost) else np.inf


def _fit_once(
    model: Model,
    records: Sequence[Record],
    start: Floats,
    nuisance: Sequence[Floats],
    phi: float,
    fixed: bool,
    most: int,
) -> Fit:
    start = np.clip(start, model.lower, model.upper)
    p = len(start)
    edges = np.cumsum([p, *(len(o) for o in nuisance)])
    rows = np.cumsum([0, *(len(r.time) for r in records)])
    shared = [] if fixed else list(range(p))

    def split(x: Floats) -> tuple[Floats, list[Floats]]:
        return x[:p], [x[edges[i] : edges[i + 1]] for i in range(len(records))]

    latest: dict[bytes, list[Floats]] = {}

    def predicted(x: Floats) -> list[Floats]:
        """Predict all recordings; the last result is kept, as the Jacobian follows the errors at the same point."""
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

    def slope(record: Record, both: Floats, here: Floats, j: int, step: float) -> Floats:
        shifted = both.copy()
        shifted[j] += step
        return (predicted_angle(model, shifted[:p], record, shifted[p:]) - here) / step

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
                if j == p + model.states:  # the prediction contains the zero as a summand
                    block[:, k] = 1.0
                    continue
                # beyond a bound the model may be undefined: take the difference on the inner side
                step = -steps[j] if j < p and both[j] + steps[j] > model.upper[j] else steps[j]
                # near divergence the plant may be finite here and diverge one step away: then take the other side
                slopes = (slope(record, both, here, j, by) for by in (step, -step))
                block[:, k] = next((one for one in slopes if np.isfinite(one).all()), 0.0)
            result[rows[i] : rows[i + 1], place] = -whiten(record, phi, block)
        return result

    x0 = np.concatenate([start, *nuisance])
    free = np.array([*shared, *range(p, len(x0))])
    lower, upper = np.full(len(x0), -np.inf), np.full(len(x0), np.inf)
    lower[:p], upper[:p] = model.lower, model.upper

    def full(x: Floats) -> Floats:
        unknowns = x0.copy()
        unknowns[free] = x
        return unknowns

    def fit_at(x: Floats, white: Floats, slopes: Floats) -> Fit:
        parameters, unknowns = split(x)
        residuals = tuple(r.angle - here for r, here in zip(records, predicted(x), strict=True))
        return Fit(model, parameters, tuple(unknowns), residuals, slopes, phi, white)

    inside = np.clip(x0, np.nextafter(lower, np.inf), np.nextafter(upper, -np.inf))
    costs = [0.5 * float(np.sum(errors(inside) ** 2))]
    if not math.isfinite(costs[0]):
        return fit_at(x0, np.full(rows[-1], np.inf), np.zeros((rows[-1], len(x0))))

    def settled(intermediate_result: OptimizeResult) -> None:
        costs.append(intermediate_result.cost)
        if len(costs) > PATIENCE and costs[-1 - PATIENCE] - costs[-1] <= 2.0 * SETTLED / rows[-1] * costs[-1]:
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
    slopes = np.zeros((rows[-1], len(x0)))
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
