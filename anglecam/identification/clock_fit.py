"""The clocks of commands from the motion alone: offset and drift of each recording, fitted together with the plant.

A command that arrives δ later moves the body δ later, so the motion shows the time between the command's stamp and its
action. That time is the sum of a clock offset and of a dead time of the mechanism. A drift of the clock is seen apart
from both, because it grows along the recording.

Offset and drift are nuisance parameters of their recording (`anglecam.models.clocked_plant`); the plant's parameters
are shared. A coarse search comes first, because the fit finds the nearest minimum only. The covariance is the larger of
that for AR(1) noise and the cluster-robust one (Liang and Zeger, Biometrika 73, 1986), as for the shared parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from anglecam.data.record import Record
from anglecam.data.typing import Floats
from anglecam.effects import Effect
from anglecam.identification.clock_search import coarse_offset
from anglecam.identification.fit import CLUSTER_FRAMES, Fit
from anglecam.identification.initial_guess import start_parameters
from anglecam.identification.noise import DOUBTFUL_RESIDUAL, RESIDUAL, angle_uncertainty, autoregression
from anglecam.identification.output_error import fit_output_error
from anglecam.models.clocked_plant import DRIFT, OFFSET, ClockedPlant, on_clock
from anglecam.models.plant import FASTEST

MOST_DRIFT_SIGMA = 0.01
"""Standard uncertainty of a drift, 10,000 ppm, above which the recordings do not determine it; clocks are then fitted
without drift. A nominal frame rate is wrong by less."""
MOST_RECORDINGS = 60
"""Recordings of more are not fitted: the whole Jacobian would need gigabytes."""
LEFT_OUT = ("dead_time", "clock_scale")
"""Effects that the clocks stand for."""


@dataclass(frozen=True)
class ClockFit:
    """Clocks of R recordings, as their motion shows them."""

    names: tuple[str, ...]
    """Of the recordings."""
    delays: Floats
    """(R,) time from a command's stamp at zero to its action on the clip's clock: clock offset plus dead time, s."""
    drifts: Floats | None
    """(R,) excess of the clip's rate over the command's; ``None`` where the recordings do not determine it, or the
    model leaves so much that it is not told from what the model lacks."""
    covariance: Floats = field(repr=False)
    """(2R, 2R) of the delays and then the drifts, s and 1; (R, R) without drifts."""
    fit: Fit = field(repr=False)
    """Plant and clocks."""


def fit_clocks(records: Sequence[Record], effects: Sequence[tuple[Effect, Floats]] = ()) -> ClockFit | None:
    """Fit the clocks of all driven recordings together with the plant.

    Parameters
    ----------
    records : sequence of Record
        Of one rig; those without a command that changes, or that never move, are left out.
    effects : sequence of (Effect, (k,) ndarray)
        Of the plant, with starting values of their parameters, SI; those that the clocks stand for are left out.

    Returns
    -------
    ClockFit or None
        ``None`` where no recording has a command that changes and an angle that moves, and for more than
        `MOST_RECORDINGS`.
    """
    driven = [
        r
        for r in records
        if r.command is not None and r.command.first_change() is not None and np.any(np.diff(r.angle))
    ]
    if not 0 < len(driven) <= MOST_RECORDINGS:
        return None
    coarse = np.array([coarse_offset(r) for r in driven])
    moved = [replace(r, command=on_clock(r.command, c)) for r, c in zip(driven, coarse, strict=True)]
    kept = [(e, values) for e, values in effects if e.id not in LEFT_OUT]
    # what the model lacks may grow along a recording as a drift does: with play, thousands of ppm are found
    most = DOUBTFUL_RESIDUAL * angle_uncertainty(driven)
    for with_drift in (True, False):
        fit = _fit(moved, kept, with_drift)
        clocks = np.array([nuisance[[OFFSET, DRIFT][: 1 + with_drift]] for nuisance in fit.nuisance])
        covariance = _clock_covariance(fit, 1 + with_drift)
        spread = np.sqrt(np.diag(covariance)[len(driven) :])
        if not with_drift or (bool(np.all(spread < MOST_DRIFT_SIGMA)) and not fit.rmse > most > 0.0):
            break
    # the drift is that of the command as it was moved: (t + coarse)(1 + ε) + δ
    drifts = clocks[:, 1] if with_drift else None
    delays = clocks[:, 0] + coarse * (1.0 if drifts is None else 1.0 + drifts)
    return ClockFit(tuple(r.name for r in driven), delays, drifts, covariance, fit)


def _fit(records: Sequence[Record], effects: Sequence[tuple[Effect, Floats]], with_drift: bool) -> Fit:
    """Fit plant and clocks, first without the noise's AR(1) coefficient and then with that of the residual."""
    starts = start_parameters(records)
    fastest = max(FASTEST, *(float(np.sqrt(start[1])) for start in starts))
    plant = ClockedPlant(tuple(e for e, _ in effects), fastest=fastest, with_drift=with_drift)
    more = [values for _, values in effects]
    fit = fit_output_error(plant, records, [np.concatenate([start, *more]) for start in starts])
    phi = autoregression(fit.residuals, RESIDUAL).phi
    return fit_output_error(plant, records, [fit.parameters], nuisance=fit.nuisance, phi=phi)


def _clock_covariance(fit: Fit, count: int) -> Floats:
    """Return the covariance of the recordings' offsets and, if ``count`` is 2, drifts, from the whole Jacobian.

    Undetermined unknowns have an infinite variance.
    """
    slopes, runs = fit.slopes, len(fit.nuisance)
    columns = [slopes.shared]
    for first, last in pairwise(slopes.edges.tolist()):
        block = np.zeros((len(fit.white), slopes.own.shape[1]))
        block[first:last] = slopes.own[first:last]
        columns.append(block)
    jacobian = np.concatenate(columns, axis=1)
    norm = np.linalg.norm(jacobian, axis=0)
    used = norm > 0.0
    scaled = jacobian[:, used] / norm[used]
    bread = np.linalg.pinv(scaled.T @ scaled, hermitian=True)
    white = fit.cost / max(1, len(fit.white) - slopes.rank) * bread
    robust = bread @ _clustered(scaled, fit) @ bread
    widened = np.sqrt(np.maximum(1.0, np.diag(robust) / np.diag(white)))
    whole = np.full((len(norm), len(norm)), np.nan)
    whole[np.ix_(used, used)] = white * np.outer(widened, widened) / np.outer(norm[used], norm[used])
    own, shared = slopes.own.shape[1], slopes.shared.shape[1]
    places = [shared + run * own + place for place in (OFFSET, DRIFT)[:count] for run in range(runs)]
    chosen = whole[np.ix_(places, places)]
    return np.where(np.isfinite(chosen), chosen, np.where(np.eye(len(places)) > 0.0, np.inf, 0.0))


def _clustered(jacobian: Floats, fit: Fit) -> Floats:
    """Return the (k, k) sum over clusters of frames of the outer products of their scores."""
    scores = [
        jacobian[i : min(i + CLUSTER_FRAMES, last)].T @ fit.white[i : min(i + CLUSTER_FRAMES, last)]
        for first, last in pairwise(fit.slopes.edges.tolist())
        for i in range(first, last, CLUSTER_FRAMES)
    ]
    stacked = np.array(scores)
    return np.asarray(stacked.T @ stacked * len(scores) / max(1, len(scores) - 1))
