"""Multiple shooting: where a long free run diverges, predict a recording in windows with separate initial states.

A free run diverges in two ways. A plant that *drifts* (no stiffness, b ≈ 0: a pole near zero; or an unstable pole)
accumulates every small torque that the model lacks until the sum hides everything else. And a model that *loses step*,
for example a linear model of a wide swing whose period depends on amplitude, is out of phase after some periods: the
cost then has many local minima, one for each miscounted period. Windows bound both errors. The initial state of each
window is a nuisance parameter of that window, and nothing ties it to the end of the window before.

The cost is two more unknowns for each window and the loss of the information that only a long run contains. Over two
time constants an initial rate is largely forgotten, so gain, damping and friction of a drifting plant are determined
nearly as well as before. Its small stiffness is then determined by the differences of b·θ between windows and no longer
by its slow decay. The standard error of a swing's frequency grows with the power 3/2 of the shortening, and with as
many windows as fit in, by the shortening itself.

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
"""Window of a drifting plant, in time constants of its fastest pole. By its end a decaying rate has lost 86 % of its
start, and a growing error has become 7.4 times as large."""
PERIODS = 2.0
"""Window of an oscillating plant, in periods. Fewer would not separate damping from an initial rate; more may lose
step again."""
MIN_WINDOWS = 4
"""Fewest windows of a drifting recording; they apply where the plant has no time constant that sets their length."""
OUT_OF_STEP = 0.25
"""RMS error of a free run, as a share of the RMS swing, above which it is out of step. For two sinusoids of one
amplitude it is a phase error of 14°; a fit that keeps step leaves no phase error."""


def drifts(plant_parameters: Floats, records: Sequence[Record]) -> bool:
    """Return whether a plant drifts or diverges over the longest of some recordings.

    It does if a real pole decays so slowly that its time constant exceeds the recording, or if a pole grows by more
    than a factor e over it.

    Parameters
    ----------
    plant_parameters : (p,) ndarray
        Parameters of the plant without effects, a (1/s) and b (1/s²) first.
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
    """Return whether a fitted model's free run is out of step with the measured angles, or runs away (no number)."""
    return not fit.rmse <= OUT_OF_STEP * rms_motion(records)


def rms_motion(records: Sequence[Record]) -> float:
    """Return the RMS distance of the measured angles from each recording's mean, rad."""
    swing = np.concatenate([r.angle - r.angle.mean() for r in records])
    return float(np.sqrt(np.mean(swing**2)))


def windows(records: Sequence[Record], plant_parameters: Floats) -> list[Record]:
    """Cut recordings into windows in which the free run of a plant does not diverge.

    Parameters
    ----------
    records : sequence of Record
        Recordings of one plant.
    plant_parameters : (p,) ndarray
        Parameters of the plant without effects as fitted so far, a (1/s) and b (1/s²) first.

    Returns
    -------
    list of Record
        Each window has its recording's name and the whole history of the command. In windows of a drifting plant the
        zero of the angle counts as known: without stiffness no angle is distinguished as neutral, and a fitted zero
        in addition to a fitted initial state would not change the prediction.
    """
    if not records:
        return []
    poles = _poles(plant_parameters)
    if drifts(plant_parameters, records):
        fastest = float(np.max(np.abs(poles.real)))
        length = TIME_CONSTANTS / fastest if fastest > 0.0 else math.inf
        return [replace(part, zero_known=True) for r in records for part in _cut(r, length, MIN_WINDOWS)]
    turns = float(np.max(np.abs(poles.imag))) or float(np.min(np.abs(poles.real)))
    return [part for r in records for part in _cut(r, PERIODS * 2.0 * math.pi / turns, 1)]


def _poles(plant_parameters: Floats) -> NDArray[np.complex128]:
    return np.roots([1.0, plant_parameters[0], plant_parameters[1]]).astype(complex)


def _cut(record: Record, length: float, fewest: int) -> list[Record]:
    """Cut one recording into windows of equal length, approximately ``length`` seconds."""
    span = float(record.time[-1] - record.time[0]) + record.interval
    most = max(1, len(record.time) // MIN_FRAMES)
    count = min(most, max(fewest, round(span / length)))
    edges = record.time[0] + span * np.arange(count + 1) / count
    parts = [record.between(start, stop) for start, stop in pairwise(edges)]
    # where frames are missing a window may have too few frames for an initial state
    return [part for part in parts if len(part.time) >= MIN_FRAMES // 2]
