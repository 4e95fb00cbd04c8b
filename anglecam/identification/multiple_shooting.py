"""Multiple shooting: where a long free run goes astray, predict a recording in windows, each from a state of its own.

A free run goes astray in two ways. A plant that *drifts* (no stiffness, b ≈ 0: a pole near zero; or an unstable one)
adds up every small torque that the model lacks until the sum hides all else. And a model that *loses count*, such as a
linear one of a wide swing whose period depends on amplitude, is out of step after some periods: the cost is then a maze
of valleys, one for each miscounted period. Windows bound both. Each window's initial state is one of its own unknowns,
and nothing ties it to the end of the window before.

What it costs: two more unknowns a window, and what only a long run tells. Over two time constants the start of a rate
is forgotten for the most part, so gain, damping and friction of a drifting plant are told nearly as well as before,
while its slow stiffness is told by how b·θ differs from window to window and no longer by its own decay. The standard
error of a swing's frequency grows with the power 3/2 of the shortening, and with as many windows as fit in, by the
shortening itself.
Bock, in Modelling of Chemical Reaction Systems, Springer 1981, 102-125; Ribeiro, Tiels, Umenberger, Schön, Aguirre, On
the smoothness of nonlinear system identification, Automatica 121, 2020, 109158.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from anglecam.data.record import MIN_FRAMES, Record
from anglecam.data.typing import Floats
from anglecam.identification.fit import Fit

TIME_CONSTANTS = 2.0
"""A drifting plant's window in time constants of its fastest pole: a decaying rate has lost 86 % of its start by then,
a growing error has become 7.4 times as large."""
PERIODS = 2.0
"""A swinging plant's window: fewer would not tell damping from an initial rate, more may lose count again."""
FEWEST = 4
"""Windows a drifting recording is cut into at least, where the plant has no time constant to go by."""
ASTRAY = 0.25
"""A free run that errs by more than this share of the swing is out of step: for two sinusoids of one amplitude it is
a phase error of 14°, of which a fit that keeps step leaves none."""


def drifts(plant_parameters: Floats, records: Sequence[Record]) -> bool:
    """Tell whether a plant drifts or runs away over the longest of some recordings.

    It does if a pole that does not swing decays too slowly to be seen decaying, its time constant longer than the
    recording, or if a pole grows by more than e over it.

    Parameters
    ----------
    plant_parameters : (p,) ndarray
        Of the plant without effects, a (1/s) and b (1/s²) first.
    records : sequence of Record
        At least one.

    Returns
    -------
    bool
        Whether the recordings should be fitted, and predicted, in `windows` throughout.
    """
    poles = _poles(plant_parameters)
    growth = float(np.max(poles.real)) * max(float(r.time[-1] - r.time[0]) for r in records)
    return growth > (1.0 if np.any(poles.imag != 0.0) else -1.0)


def loses_step(fit: Fit, records: Sequence[Record]) -> bool:
    """Tell whether a fitted model's free run is out of step with what was measured."""
    swing = np.concatenate([r.angle - r.angle.mean() for r in records])
    return fit.rmse > ASTRAY * float(np.sqrt(np.mean(swing**2)))


def windows(records: Sequence[Record], plant_parameters: Floats) -> list[Record]:
    """Cut recordings into windows that a plant cannot run astray in.

    Parameters
    ----------
    records : sequence of Record
        Recordings of one plant.
    plant_parameters : (p,) ndarray
        Of the plant without effects as fitted so far, a (1/s) and b (1/s²) first.

    Returns
    -------
    list of Record
        Each window under its recording's name, with the whole history of the command. In windows of a plant that
        drifts the zero that the angle came with counts as known: where no stiffness tells which angle is neutral, a
        zero of its own beside an initial state of its own would leave a prediction as it is.
    """
    if not records:
        return []
    poles = _poles(plant_parameters)
    if drifts(plant_parameters, records):
        fastest = float(np.max(np.abs(poles.real)))
        length = TIME_CONSTANTS / fastest if fastest > 0.0 else math.inf
        return [replace(part, zero_known=True) for r in records for part in _cut(r, length, FEWEST)]
    turns = float(np.max(np.abs(poles.imag))) or float(np.min(np.abs(poles.real)))
    return [part for r in records for part in _cut(r, PERIODS * 2.0 * math.pi / turns, 1)]


def _poles(plant_parameters: Floats) -> NDArray[np.complex128]:
    return np.roots([1.0, plant_parameters[0], plant_parameters[1]]).astype(complex)


def _cut(record: Record, length: float, fewest: int) -> list[Record]:
    """Cut one recording into windows of equal length (s), about as long as asked for."""
    span = float(record.time[-1] - record.time[0]) + record.interval
    most = max(1, len(record.time) // MIN_FRAMES)
    count = min(most, max(fewest, round(span / length)))
    edges = record.time[0] + span * np.arange(count + 1) / count
    parts = [record.between(start, stop) for start, stop in pairwise(edges)]
    # where frames are missing a window may be left with too few for a state of its own
    return [part for part in parts if len(part.time) >= MIN_FRAMES // 2]
