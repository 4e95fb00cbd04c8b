"""Output error: the parameters minimise the difference between the measured angle and that of a free run.

    minimise Σ_recordings |W(y − z − θ(t; p, x₀))|²  over p (shared) and x₀, z (each recording's nuisance)

W whitens first-order autoregressive noise, so that correlated residuals do not count as as many independent
observations. The initial state x₀ and, unless declared, the zero z of the angle are unknown in every recording.
Ljung, System Identification, 2nd ed., 1999, sec. 7.5.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from threadpoolctl import ThreadpoolController

from anglecam.data.record import Record
from anglecam.data.typing import Floats
from anglecam.identification.fit import Fit
from anglecam.identification.joined import Joined, join
from anglecam.identification.slopes import Slopes
from anglecam.identification.variable_projection import fit_nuisance, fit_shared, point_at
from anglecam.models.model import Model

TRIAL_EVALUATIONS = 8
"""Evaluations of each of several starts before only the best `CONTINUED` of them are continued."""
CONTINUED = 2
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
    """Fit as `fit_output_error` does, but continue only the starts that are best after a few steps.

    For models whose fits are slow; a few steps find the deepest minimum almost as reliably.
    """
    trials = sorted(_fit_all(model, records, starts, nuisance, phi, False, TRIAL_EVALUATIONS), key=lambda fit: fit.cost)
    fits = [
        fit_output_error(model, records, [trial.parameters], nuisance=trial.nuisance, phi=phi)
        for trial in trials[:CONTINUED]
    ]
    return min(fits, key=lambda fit: fit.cost)


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
    own = joined.stack(nuisance)
    unknown = joined.fitted(own)
    begin = point_at(model, joined, np.clip(start, model.lower, model.upper), own)
    if not math.isfinite(begin.cost):
        rows = len(joined.angle)
        slopes = Slopes(np.zeros((rows, len(start))), np.zeros((rows, own.shape[1])), joined.runs.edges)
        end = replace(begin, white=np.full(rows, np.inf))
    elif fixed:
        end, slopes = fit_nuisance(model, joined, begin, most)
    else:
        end, slopes = fit_shared(model, joined, begin, most)
    residuals = tuple(joined.runs.split(joined.angle - end.predicted.angle))
    fitted = tuple(one[which] for one, which in zip(end.own, unknown, strict=True))
    return Fit(model, end.parameters, fitted, residuals, slopes, phi, end.white)


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
