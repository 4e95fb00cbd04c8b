"""Residual torque: the torque that would have caused the residual angle, by inverse dynamics of the base model.

    τ = ë + a·ė + b·e

A torque τ that the plant θ̈ = c·u − a·θ̇ − b·θ lacks changes its angle by the e that solves this equation, whatever the
command. The derivatives are those of local quadratics (Savitzky and Golay, Anal. Chem. 36, 1964; Cleveland, J. Am.
Stat. Assoc. 74, 1979), over the longest window whose torque still agrees within the noise with that of every shorter
one (Lepski, Theory Probab. Appl. 35, 1990). They are linear in the residual, so the standard deviation of the torque
follows from the noise in every frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anglecam.data.record import Record
from anglecam.data.typing import Floats
from anglecam.identification.fit import Fit
from anglecam.identification.noise import Noise

REACHES = (3, 4, 6, 8, 11, 15, 20)
"""Half-lengths, in frames, of the windows that are tried."""
WINDOWS_PER_RECORDING = 8
"""A window is at most one part in this many of the shortest recording."""


@dataclass(frozen=True)
class ResidualTorque:
    """The residual torque of one recording, and the quantities on which it may depend; arrays of length n."""

    name: str
    time: Floats
    """s."""
    torque: Floats
    """Per moment of inertia, rad/s²."""
    sigma: Floats
    """Standard deviation of ``torque`` due to the noise of the angle, rad/s²."""
    angle: Floats
    """Angle that the model predicts, rad."""
    velocity: Floats
    """Velocity that the model predicts, rad/s."""
    command: Floats | None
    """rad; ``None`` for a free swing."""


def estimate_residual_torque(fit: Fit, records: Sequence[Record], noise: Noise) -> list[ResidualTorque]:
    """Return the torque that would have caused the residual of a fitted plant.

    Parameters
    ----------
    fit : Fit
        Of a plant without effects; its a and b are used.
    records : sequence of Record
        The fitted recordings.
    noise : Noise
        Of the angle.

    Returns
    -------
    list of ResidualTorque
        One for each recording, without the frames at its ends that have no full window around them.
    """
    operator = np.array([fit.parameters[1], fit.parameters[0], 1.0])
    shortest = min(len(r.time) for r in records)
    tried: list[list[tuple[Floats, Floats]]] = []
    for reach in [r for r in REACHES if r == REACHES[0] or 2 * r + 1 <= shortest / WINDOWS_PER_RECORDING]:
        torques = [_torque(r, e, operator, reach, noise) for r, e in zip(records, fit.residuals, strict=True)]
        if not all(_agree(torques, shorter) for shorter in tried):
            break
        tried.append(torques)
    reach = REACHES[len(tried) - 1]
    return [
        _with_motion(record, error, torque, sigma, slice(reach, -reach))
        for record, error, (torque, sigma) in zip(records, fit.residuals, tried[-1], strict=True)
    ]


def _torque(record: Record, error: Floats, operator: Floats, reach: int, noise: Noise) -> tuple[Floats, Floats]:
    """Return torque and standard deviation at every frame, (n,) each; at the ends the windows are one-sided."""
    torque, sigma = np.empty(len(error)), np.empty(len(error))
    frames = record.time / record.interval
    for i in range(len(error)):
        near, weights = _quadratic(record.time, i, reach)
        row = operator @ weights
        correlation = noise.phi ** np.abs(frames[near, None] - frames[near])
        torque[i], sigma[i] = row @ error[near], noise.sigma * np.sqrt(row @ correlation @ row)
    return torque, sigma


def _agree(longer: Sequence[tuple[Floats, Floats]], shorter: Sequence[tuple[Floats, Floats]]) -> bool:
    """Return whether two torques differ by no more than the noise of the shorter window's, which is the larger."""
    off = np.concatenate([new - old for (new, _), (old, _) in zip(longer, shorter, strict=True)])
    sigma = np.concatenate([sigma for _, sigma in shorter])
    return bool(np.sum(off**2) <= np.sum(sigma**2))


def _with_motion(record: Record, error: Floats, torque: Floats, sigma: Floats, kept: slice) -> ResidualTorque:
    path = record.angle - error
    return ResidualTorque(
        record.name,
        record.time[kept],
        torque[kept],
        sigma[kept],
        path[kept],
        np.gradient(path, record.time)[kept],
        None if record.command is None else record.command.at(record.time)[kept],
    )


def _quadratic(time: Floats, at: int, reach: int) -> tuple[NDArray[np.intp], Floats]:
    """Return the k frames around one, and the (3, k) weights that give value, slope and curvature there."""
    near = np.arange(max(0, at - reach), min(len(time), at + reach + 1))
    off = time[near] - time[at]
    unit = np.max(np.abs(off))
    x = off / unit
    weights = np.linalg.pinv(np.column_stack([np.ones_like(x), x, 0.5 * x**2]))
    return near, weights / np.array([1.0, unit, unit**2])[:, None]
