"""Output error: the model runs freely, and its parameters are those whose angle is nearest to the measured one.

    minimise Σ_recordings |W(y − z − θ(t; p, x₀))|²  over p (shared) and x₀, z (each recording's nuisance)

W whitens first-order autoregressive noise, so that a coloured residual is not counted as so many independent
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
"""Of the difference quotients, as a share of a parameter."""
SETTLED = 1e-3
"""Log-likelihood; a fit that has gained no more by its last `PATIENCE` steps is as good as it will be. Along a ridge it
would crawl for many more, and where the angle has kinks one small step may come before a large one."""
PATIENCE = 3
RUNAWAY = 1e100
"""rad; a plant that comes so far has run away: the squares of its slopes would soon have no number."""
HEAT, MOST = 8, 60
"""Evaluations that each of several starts is given before the best of them goes on, and that a fit may take."""
_BLAS = ThreadpoolController()
"""The matrices here have some twenty columns: threads that wait for each other made a fit ten times slower."""


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
        What to fit.
    records : sequence of Record
        All fitted at once.
    starts : sequence of (p,) ndarray
        Shared parameters to start from, SI; the best end is kept.
    nuisance : sequence of ndarray, optional
        Starts of each recording's nuisance unknowns; from its first frames otherwise.
    phi : float
        Autocorrelation of the noise from frame to frame.
    fixed : bool
        Hold the shared parameters at ``starts[0]`` and fit only what is each recording's nuisance: a prediction.

    Returns
    -------
    Fit
        The best of the starts.
    """
    nuisance = [first_state(model, record) for record in records] if nuisance is None else nuisance
    return min(_fit_all(model, records, starts, nuisance, phi, fixed, MOST), key=lambda fit: fit.cost)


def fit_best_start(
    model: Model, records: Sequence[Record], starts: Sequence[Floats], nuisance: Sequence[Floats], phi: float
) -> Fit:
    """Fit as `fit_output_error` does, but go on from only one start: the best after a few steps from each.

    For models whose fits are slow; which valley is the deepest is then known almost as well.
    """
    heats = _fit_all(model, records, starts, nuisance, phi, False, HEAT)
    best = min(heats, key=lambda fit: fit.cost)
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
    # a trial step may let the plant run away; its cost is then not finite and the step is refused
    with _BLAS.limit(limits=1, user_api="blas"), np.errstate(over="ignore", invalid="ignore"):
        return [_fit_once(model, records, start, nuisance, phi, fixed, most) for start in starts]


def predict_output_error(fit: Fit, records: Sequence[Record]) -> Fit:
    """Predict recordings in free run with the parameters of ``fit``; only initial states and zeros are fitted.

    They start from the first frames, and also from rest: with dry friction the two may end in different valleys.
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
    """Return the (n,) angle, rad, that a model gives a recording from its nuisance unknowns; NaN where it runs away."""
    zero = 0.0 if record.zero_known else nuisance[model.states]
    angle = zero + model.predict(parameters, record.time, record.command, nuisance[: model.states], record.view)
    return np.where(np.abs(angle) < RUNAWAY, angle, np.nan)


def output_error(
    model: Model, parameters: Floats, records: Sequence[Record], nuisance: Sequence[Floats], phi: float
) -> float:
    """Return the sum of squared whitened residuals, rad², of a model as it stands; infinite where it runs away."""
    with np.errstate(over="ignore", invalid="ignore"):
        left = [
            whiten(r, phi, r.angle - predicted_angle(model, parameters, r, o))
            for r, o in zip(records, nuisance, strict=True)
        ]
        cost = float(sum(one @ one for one in left))
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

    def slope(record: Record, both: Floats, here: Floats, j: int, step: float) -> Floats:
        beside = both.copy()
        beside[j] += step
        return (predicted_angle(model, beside[:p], record, beside[p:]) - here) / step

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
                # where the plant just does not run away here it may beside it: then on the other side
                slopes = (slope(record, both, here, j, by) for by in (step, -step))
                block[:, k] = next((one for one in slopes if np.isfinite(one).all()), 0.0)
            result[rows[i] : rows[i + 1], place] = -whiten(record, phi, block)
        return result

    x0 = np.concatenate([start, *nuisance])
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
    """Start a recording's nuisance unknowns at its first angle, and at rest if its command has held it there.

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
