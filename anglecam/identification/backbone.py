"""Free swings without a model: how period and damping depend on the amplitude, cycle by cycle.

    θ(t) = m + A·sin(2π(t − τ)/T)     from one upward crossing of the middle to the next

A linear spring gives one period at all amplitudes; a pendulum's grows with the amplitude (the backbone curve). Linear
damping takes away the same share of the amplitude in each cycle, dry friction the same amount, drag the more the larger
it is (the damping curve). Over exactly one period harmonics are orthogonal to the sine, so that they shift neither A
nor T. Kerschen, Worden, Vakakis, Golinval, Mech. Syst. Signal Process. 20, 2006, 505-592, sec. 4.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy import optimize

from anglecam.data.record import Record
from anglecam.data.typing import Floats

FEWEST_CYCLES = 3
FEWEST_FRAMES = 6
"""Frames of a cycle: its sine has four parameters."""
APART = 0.6
"""Least time between two upward crossings, in usual periods; noise crosses the middle several times."""
LONGEST_GAP = 0.25
"""Largest gap between two frames of a cycle, in its period."""
SEEN_SIGMAS = 5.0
"""Least amplitude of a cycle, in standard deviations of its residual: a smaller one is one of noise."""


@dataclass(frozen=True)
class Backbone:
    """The cycles of one recording; arrays of length n, standard uncertainties beside."""

    name: str
    """Of the recording."""
    time: Floats
    """Middle of each cycle, s."""
    amplitude: Floats
    """Rad."""
    amplitude_sigma: Floats
    """Rad."""
    period: Floats
    """S."""
    period_sigma: Floats
    """S."""
    decay: Floats
    """Twice the rate at which the logarithm of the amplitude falls to the next cycle, 1/s: a of a linear swing. NaN
    where the next cycle is not seen."""
    decay_sigma: Floats
    """1/s."""


def backbones(records: Sequence[Record]) -> list[Backbone]:
    """Return the backbone and damping curves of free swings.

    Parameters
    ----------
    records : sequence of Record
        Recordings, or the windows of them in their order.

    Returns
    -------
    list of Backbone
        Of each recording without a command in which at least `FEWEST_CYCLES` cycles are seen.
    """
    found = []
    for name in dict.fromkeys(r.name for r in records if r.command is None):
        parts = [r for r in records if r.name == name]
        time, angle = (np.concatenate([getattr(r, one) for r in parts]) for one in ("time", "angle"))
        order = np.unique(time, return_index=True)[1]
        one = _backbone(name, time[order], angle[order])
        if one is not None:
            found.append(one)
    return found


def _backbone(name: str, time: Floats, angle: Floats) -> Backbone | None:
    usual = _usual_period(time, angle)
    cycles = [_cycle(time, angle, *ends) for ends in pairwise(_crossings(time, angle, usual))]
    seen = [one is not None for one in cycles]
    if sum(seen) < FEWEST_CYCLES:
        return None
    middle, amplitude, amplitude_sigma, period, period_sigma = np.array([one for one in cycles if one is not None]).T
    decay, decay_sigma = np.full((2, len(middle)), np.nan)
    follows = np.array(seen[1:])[np.array(seen[:-1])]  # of each cycle that is seen, whether the next one is
    for k in np.flatnonzero(follows):
        rate = 2.0 / (middle[k + 1] - middle[k])
        decay[k] = rate * math.log(amplitude[k] / amplitude[k + 1])
        decay_sigma[k] = rate * math.hypot(*(amplitude_sigma[k : k + 2] / amplitude[k : k + 2]))
    return Backbone(name, middle, amplitude, amplitude_sigma, period, period_sigma, decay, decay_sigma)


def _usual_period(time: Floats, angle: Floats) -> float:
    """Return the period of the largest sine, s."""
    step = float(np.median(np.diff(time)))
    even = np.interp(np.arange(time[0], time[-1], step), time, angle)
    power = np.abs(np.fft.rfft(even - even.mean())) ** 2
    return step * len(even) / max(1, int(np.argmax(power[1:])) + 1) if len(power) > 1 else math.inf


def _crossings(time: Floats, angle: Floats, usual: float) -> list[float]:
    """Return the instants, s, at which the angle crosses its local middle upwards."""
    half = 0.5 * usual
    first, last = np.searchsorted(time, time - half), np.searchsorted(time, time + half, side="right")
    sums = np.concatenate([[0.0], np.cumsum(angle)])
    off = angle - (sums[last] - sums[first]) / (last - first)
    found: list[float] = []
    for k in np.flatnonzero((off[:-1] < 0.0) & (off[1:] >= 0.0)):
        at = float(time[k] - off[k] * (time[k + 1] - time[k]) / (off[k + 1] - off[k]))
        if not found or at - found[-1] > APART * usual:
            found.append(at)
    return found


def _cycle(time: Floats, angle: Floats, start: float, stop: float) -> tuple[float, float, float, float, float] | None:
    """Return middle, amplitude, its sigma, period and its sigma of one cycle; ``None`` where it is not seen."""
    inside = (time >= start) & (time < stop)
    t, y, guess = time[inside], angle[inside], stop - start
    if len(t) < FEWEST_FRAMES or np.max(np.diff([start, *t, stop])) > LONGEST_GAP * guess:
        return None
    begin = np.array([float(y.mean()), float(np.ptp(y)) / 2.0, start, guess])
    try:
        # its residual shows the noise, and with that the covariance
        values, covariance = optimize.curve_fit(_sine, t, y, begin, maxfev=400)
    except RuntimeError:
        return None
    rms = math.sqrt(float(np.sum((y - _sine(t, *values)) ** 2)) / max(1, len(t) - len(values)))
    amplitude, period = abs(float(values[1])), float(values[3])
    sigmas = np.sqrt(np.diag(covariance))
    if not (np.all(np.isfinite(sigmas)) and amplitude > SEEN_SIGMAS * rms and APART < period / guess < 1.0 / APART):
        return None
    return 0.5 * (start + stop), amplitude, float(sigmas[1]), period, float(sigmas[3])


def _sine(t: Floats, middle: float, amplitude: float, start: float, period: float) -> Floats:
    return middle + amplitude * np.sin(2.0 * np.pi * (t - start) / period)
