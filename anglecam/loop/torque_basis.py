"""What any torque would change that depends on the angle alone, or on the speed alone, whatever its curve.

    τ(θ) = Σ τₖ·hatₖ(θ),     τ(θ̇) = Σ τₖ·hatₖ(θ̇),     ë + a·ė + b·e = τ

A curve of straight lines between knots stands for any curve: each hat is put through the plant along the path that the
model takes, and the space of the answers is what such a torque can leave in a residual. No entry of the ledger is
needed for it, so it also sees what the ledger does not have.
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
"""Knots of a curve over the angle, from the lowest to the highest."""
SPEEDS = np.array([-1.0, -0.3, -0.1, -0.03, 0.0, 0.03, 0.1, 0.3, 1.0])
"""Knots of a curve over the speed, of the largest: close about rest, where friction has its kinks."""
PARTS = 4
"""Of a frame's interval, in which a torque is held."""


def torque_responses(fit: Fit, records: Sequence[Record]) -> dict[str, Floats]:
    """Put curves of torque over angle and over speed through a fitted plant.

    Parameters
    ----------
    fit : Fit
        Of a `Plant`; a and b are those of its linear part.
    records : sequence of Record
        Those that it was fitted to.

    Returns
    -------
    dict
        ``angle`` and ``velocity`` → (N, k) changes of the whitened residual, a column a knot.
    """
    plant = plant_of(fit)
    times = [_between(record.time) for record in records]
    paths = [
        plant.run(fit.parameters, time, record.command, own[: plant.states])
        for time, record, own in zip(times, records, fit.nuisance, strict=True)
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
            answers = [
                Plant().predict(linear, record.time, Command(time[:-1], hat), np.zeros(plant.states)) for hat in hats
            ]
            blocks.append(whiten(record, fit.phi, np.column_stack(answers)))
        found[name] = np.concatenate(blocks)
    return found


def _between(time: Floats) -> Floats:
    """Divide every interval between frames."""
    steps = np.arange(PARTS) / PARTS
    return np.append((time[:-1, None] + steps * np.diff(time)[:, None]).ravel(), time[-1])
