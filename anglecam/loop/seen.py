"""Works out `Seen` of a fitted plant: its motion, and what a torque of any shape would explain of a residual.

A torque τ(t) changes the angle of the linear plant by the e of ë + a·ė + b·e = τ. Whitened and without the part that
the fit's parameters can follow, e is compared with the residual by least squares.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numba import njit
from scipy.linalg import expm

from anglecam.data.record import Record
from anglecam.data.typing import Floats
from anglecam.effects.seen import Seen
from anglecam.identification.fit import Fit
from anglecam.identification.joined import RUNAWAY, join
from anglecam.loop.refit import plant_of

STEP = 4.0 / 3.0
"""Longest steps of the integrator between the instants at which a torque is given; it is linear between them."""
AT_ONCE = 64
"""Columns of torques that are handled at a time, which limits the memory."""


def seen_of(fit: Fit, records: Sequence[Record]) -> Seen:
    """Return what a fitted plant shows.

    Parameters
    ----------
    fit : Fit
        Of a `Plant`, on ``records``.
    records : sequence of Record
        The fitted recordings.

    Returns
    -------
    Seen
        Motion and residual.
    """
    plant = plant_of(fit)
    times, motion = dense_motion(fit, records)
    levels = [np.zeros(len(t)) if r.command is None else r.command.at(t) for t, r in zip(times, records, strict=True)]
    angle, rate = np.concatenate(motion).T
    command = np.concatenate(levels)
    abc = np.zeros(3)
    abc[: plant.base_count] = fit.parameters[: plant.base_count]
    a, b, c = abc.tolist()

    def explained(torques: Sequence[Floats]) -> tuple[Floats, Floats]:
        return _explained(fit, records, times, torques)

    return Seen(
        a,
        b,
        c,
        float(angle.min()),
        float(angle.max()),
        float(np.abs(rate).max()),
        float(np.abs(command).max()),
        float(np.abs(c * command - b * angle).max()),
        max(float(r.time[-1] - r.time[0]) for r in records),
        float(np.median([r.interval for r in records])),
        tuple(times),
        tuple(states[:, 0] for states in motion),
        explained,
    )


def dense_motion(fit: Fit, records: Sequence[Record]) -> tuple[list[Floats], list[Floats]]:
    """Run a fitted plant through its recordings.

    Parameters
    ----------
    fit : Fit
        Of a `Plant`, on ``records``.
    records : sequence of Record
        The fitted recordings.

    Returns
    -------
    times : list of (n,) ndarray
        Evenly spaced instants from the first frame of each recording to the last, at most `STEP` steps apart, s.
    motion : list of (n, 2) ndarray
        Angle, rad, and rate, rad/s, at these instants.
    """
    plant = plant_of(fit)
    step = STEP * plant.smooth_step
    spans = [(r.time[0], r.time[-1]) for r in records]
    times = [np.linspace(first, last, math.ceil((last - first) / step) + 1) for first, last in spans]
    motion = [
        plant.run(fit.parameters, time, record.command, nuisance[: plant.states])
        for time, record, nuisance in zip(times, records, fit.nuisance, strict=True)
    ]
    return times, motion


def largest_shares(
    fit: Fit, records: Sequence[Record], times: Sequence[Floats], torques: Sequence[Floats], residuals: Floats
) -> Floats:
    """Return the share of each residual's energy that the best of several pairs of torques explains.

    Parameters
    ----------
    fit : Fit
        Of a `Plant`, on ``records``.
    records : sequence of Record
        The fitted recordings.
    times : sequence of (n,) ndarray
        `Seen.times` of the fit.
    torques : sequence of (n, 2k) ndarray
        For each recording: k pairs of columns.
    residuals : (N, m) ndarray
        Whitened residuals without the part that the fit's parameters can follow.

    Returns
    -------
    (m,) ndarray
        Largest over the pairs.
    """
    found = np.zeros(residuals.shape[1])
    for change, whole in _changes(fit, records, times, torques):
        one, two = change[:, 0::2], change[:, 1::2]
        one = one * _inverse(np.linalg.norm(one, axis=0), whole[0::2])
        two = two - one * np.sum(one * two, axis=0)
        two = two * _inverse(np.linalg.norm(two, axis=0), whole[1::2])
        along = [pair.T.astype(residuals.dtype) @ residuals for pair in (one, two)]  # no copy in another precision
        found = np.maximum(found, (along[0] ** 2 + along[1] ** 2).max(axis=0))
    energy = np.einsum("ij,ij->j", residuals, residuals, dtype=float)
    return np.minimum(found / np.where(energy > 0.0, energy, 1.0), 1.0)


def _inverse(length: Floats, whole: Floats) -> Floats:
    """Return 1/length; 0 for what is only the rounding error of a column as long as ``whole``."""
    kept = length > 1e-3 * whole
    return np.where(kept, 1.0 / np.where(kept, length, 1.0), 0.0)


def _changes(
    fit: Fit, records: Sequence[Record], times: Sequence[Floats], torques: Sequence[Floats]
) -> Iterator[tuple[Floats, Floats]]:
    """Yield `AT_ONCE` torques' changes of the whitened angles that the fit cannot follow, and the norms of all of it.

    A change that is not finite, or would not be when squared, is zero.
    """
    joined = join(records, fit.phi)
    for begin in range(0, torques[0].shape[1], AT_ONCE):
        blocks = [
            torque_response(t, torque[:, begin : begin + AT_ONCE], record.time, *fit.parameters[:2])
            for t, torque, record in zip(times, torques, records, strict=True)
        ]
        change = joined.whiten(np.concatenate(blocks))
        change[:, ~np.all(np.abs(change) < RUNAWAY, axis=0)] = 0.0
        yield fit.slopes.without_followed(change), np.linalg.norm(change, axis=0)


def _explained(
    fit: Fit, records: Sequence[Record], times: Sequence[Floats], torques: Sequence[Floats]
) -> tuple[Floats, Floats]:
    """Return the best multiples (k, 2) of k pairs of torques, and the shares of the residual's energy, (k,)."""
    left = fit.slopes.without_followed(fit.white)
    energy = float(left @ left)
    multiples, shares = [], []
    for change, whole in _changes(fit, records, times, torques):
        size = np.maximum(whole[0::2], whole[1::2])
        size = np.where(size > 0.0, size, 1.0)
        one, two = change[:, 0::2] / size, change[:, 1::2] / size
        # a little more on the diagonal, so that a pair which the fit can follow explains nothing
        p, q, r = np.sum(one**2, axis=0) + 1e-6, np.sum(one * two, axis=0), np.sum(two**2, axis=0) + 1e-6
        along = np.stack([left @ one, left @ two])
        found = np.stack([r * along[0] - q * along[1], p * along[1] - q * along[0]]) / (p * r - q**2)
        multiples.append((found / size).T)
        shares.append(np.sum(found * along, axis=0) / energy if energy > 0.0 else 0.0 * p)
    return np.nan_to_num(np.concatenate(multiples)), np.nan_to_num(np.concatenate(shares))


def torque_response(time: Floats, torque: Floats, frames: Floats, a: float, b: float) -> Floats:
    """Return the change of the angle at the frames, (n, k), by (m, k) torques at evenly spaced instants."""
    h = float(time[1] - time[0])
    # the state and a torque that is linear over a step, under the matrix exponential
    matrix = np.zeros((4, 4))
    matrix[0, 1], matrix[1, :3], matrix[2, 3] = 1.0, (-b, -a, 1.0), 1.0 / h
    with np.errstate(over="ignore", invalid="ignore"):
        angle = _filtered(np.ascontiguousarray(expm(h * matrix)[:2]), np.ascontiguousarray(torque))
    place = np.clip((frames - time[0]) / h, 0.0, len(time) - 1.0)
    i = np.minimum(place.astype(int), len(time) - 2)
    part = (place - i)[:, None]
    return (1.0 - part) * angle[i] + part * angle[i + 1]


@njit("(float64[:, ::1], float64[:, ::1])", nogil=True, cache=True)
def _filtered(step: Floats, torque: Floats) -> Floats:
    """Return the angles, (m, k), from rest; ``step`` maps angle, rate, torque and its rise to the next two."""
    m, k = torque.shape
    angle, rate = np.zeros((m, k)), np.zeros(k)
    for i in range(1, m):
        for j in range(k):
            now, rise = torque[i - 1, j], torque[i, j] - torque[i - 1, j]
            before, speed = angle[i - 1, j], rate[j]
            angle[i, j] = step[0, 0] * before + step[0, 1] * speed + step[0, 2] * now + step[0, 3] * rise
            rate[j] = step[1, 0] * before + step[1, 1] * speed + step[1, 2] * now + step[1, 3] * rise
    return angle
