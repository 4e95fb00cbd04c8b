"""Responses to an arbitrary torque that depends on the angle alone, or on the speed alone.

    τ(θ) = Σ τₖ·hatₖ(θ),     τ(θ̇) = Σ τₖ·hatₖ(θ̇),     ë + a·ė + b·e = τ

The curve is piecewise linear: a sum of hat functions with free coefficients. Each hat function, evaluated along the
path of the model, is a torque that drives the linear plant; the span of the responses e contains every residual that
such a torque can leave. The effects of the ledger are not used, so torques that the ledger lacks are covered, too.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from anglecam.data.command import Command
from anglecam.data.record import Record
from anglecam.data.typing import Floats
from anglecam.identification.fit import Fit, whiten
from anglecam.loop.refit import plant_of
from anglecam.models.plant import Plant

ANGLES = 9
"""Number of knots of a curve over the angle, evenly spaced from the lowest to the highest angle."""
SPEEDS = np.array([-1.0, -0.3, -0.1, -0.03, 0.0, 0.03, 0.1, 0.3, 1.0])
"""Knots of a curve over the speed, as shares of the largest speed; dense around rest, where friction has kinks."""
SUBSTEPS = 4
"""Per frame interval; the torque is constant in each."""


def torque_responses(fit: Fit, records: Sequence[Record]) -> dict[str, Floats]:
    """Return the changes of the whitened residual by each hat function of torque over angle and over speed.

    Parameters
    ----------
    fit : Fit
        Of a `Plant`; a and b of its linear part are used.
    records : sequence of Record
        The recordings that it was fitted to.

    Returns
    -------
    dict
        ``angle`` and ``velocity`` → (N, k), one column for each knot.
    """
    plant = plant_of(fit)
    times = [_substeps(record.time) for record in records]
    paths = [
        plant.run(fit.parameters, time, record.command, nuisance[: plant.states])
        for time, record, nuisance in zip(times, records, fit.nuisance, strict=True)
    ]
    whole = np.concatenate(paths)
    angles = np.linspace(whole[:, 0].min(), whole[:, 0].max(), ANGLES)
    knots = {"angle": angles, "velocity": SPEEDS * np.abs(whole[:, 1]).max()}
    linear = np.array([*fit.parameters[:2], 1.0])
    found: dict[str, Floats] = {}
    for column, (name, at) in enumerate(knots.items()):
        blocks = []
        for record, time, path in zip(records, times, paths, strict=True):
            held = 0.5 * (path[:-1, column] + path[1:, column])
            hats = [np.interp(held, at, hat) for hat in np.eye(len(at))]
            responses = [
                Plant().predict(linear, record.time, Command(time[:-1], hat), np.zeros(plant.states)) for hat in hats
            ]
            blocks.append(whiten(record, fit.phi, np.column_stack(responses)))
        found[name] = np.concatenate(blocks)
    return found


def _substeps(time: Floats) -> Floats:
    """Divide every frame interval into `SUBSTEPS`."""
    steps = np.arange(SUBSTEPS) / SUBSTEPS
    return np.append((time[:-1, None] + steps * np.diff(time)[:, None]).ravel(), time[-1])
