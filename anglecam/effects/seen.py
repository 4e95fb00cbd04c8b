"""What a fitted model shows of the recordings: from it an effect works out where its own fit starts.

The magnitude of a torque follows from the plant, a stop lies within the range of the motion, and a frequency stands in
the residual.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from anglecam.data.typing import Floats


class Motion(NamedTuple):
    """The motion that recordings show."""

    low: float
    """Lowest angle, rad."""
    high: float
    """Highest angle, rad."""
    usual: tuple[float, float]
    """Range of the angle for nine tenths of the time, rad."""
    span: float
    """Duration of the longest recording, s."""


class Wave(NamedTuple):
    """A torque amplitude·sin(wave number·x + phase)."""

    amplitude: float
    """rad/s²."""
    number: float
    """Radians per unit of x."""
    phase: float
    """rad."""


@dataclass(frozen=True)
class Seen:
    """A fitted plant and its motion through the fitted recordings."""

    a: float
    """1/s."""
    b: float
    """1/s²."""
    c: float
    """1/s²; 0 for a free swing."""
    low: float
    """Lowest predicted angle, rad."""
    high: float
    """Highest predicted angle, rad."""
    speed: float
    """Largest predicted speed, rad/s."""
    command: float
    """Largest magnitude of the command, rad; 0 for a free swing."""
    torque: float
    """Largest magnitude of c·u − b·θ, rad/s²."""
    span: float
    """Duration of the longest recording, s."""
    interval: float
    """Median frame interval, s."""
    times: tuple[Floats, ...] = field(repr=False)
    """Instants in each recording, s, denser than its frames."""
    angles: tuple[Floats, ...] = field(repr=False)
    """Predicted angle at these instants, rad."""
    explained: Callable[[Sequence[Floats]], tuple[Floats, Floats]] = field(repr=False)
    """(torques, (n, 2k) for each recording at ``times``) → for each of k pairs of columns the best multiples (k, 2),
    and the share of the residual's energy that they explain (k,)."""

    @property
    def usual(self) -> tuple[float, float]:
        """Range of the predicted angle for nine tenths of the time, rad."""
        return usual_range(np.concatenate(self.angles))

    @property
    def reach(self) -> float:
        """Largest magnitude of the predicted angle, rad."""
        return max(abs(self.low), abs(self.high))

    @property
    def stiffness(self) -> float:
        """Magnitude of b, 1/s²; at least one that matters over the longest recording."""
        return max(abs(self.b), self.span**-2)

    def waves(self, along: Sequence[Floats], numbers: Floats, most: int) -> list[Wave]:
        """Return the sinusoidal torques that explain most of the residual.

        Parameters
        ----------
        along : sequence of (n,) ndarray
            x at ``times`` of each recording: time, or angle.
        numbers : (k,) ndarray
            Wave numbers to try, ascending by one step, rad per unit of x.
        most : int
            Largest number of waves.

        Returns
        -------
        list of Wave
            Best first; maxima of the explained share, each refined to an eighth of the step.
        """
        share = self._pairs(along, numbers)[1]
        inner = (share[1:-1] >= share[:-2]) & (share[1:-1] >= share[2:])
        peaks = sorted(np.flatnonzero(inner) + 1, key=lambda i: -share[i])[:most]
        step, found = float(numbers[1] - numbers[0]), []
        for peak in peaks:
            near = numbers[peak] + step * np.linspace(-0.75, 0.75, 13)
            multiples, finer = self._pairs(along, near)
            i = int(np.argmax(finer))
            sine, cosine = multiples[i].tolist()
            found.append(Wave(float(np.hypot(sine, cosine)), float(near[i]), float(np.arctan2(cosine, sine))))
        return found

    def _pairs(self, along: Sequence[Floats], numbers: Floats) -> tuple[Floats, Floats]:
        return self.explained(sines_and_cosines(along, numbers))


def usual_range(angle: Floats) -> tuple[float, float]:
    """Return the range in which angles, (n,) rad, are for nine tenths of the time.

    The extremes of noise and of a multisine, which are reached once, are twice as far apart.
    """
    low, high = np.quantile(angle, (0.05, 0.95))
    return float(low), float(high)


def sines_and_cosines(along: Sequence[Floats], numbers: Floats) -> list[Floats]:
    """Return sin and cos of wave numbers·x in pairs of columns, (n, 2k), for each recording's x, (n,)."""
    torques = [np.empty((len(x), 2 * len(numbers))) for x in along]
    for torque, x in zip(torques, along, strict=True):
        phase = np.outer(x, numbers)
        torque[:, 0::2], torque[:, 1::2] = np.sin(phase), np.cos(phase)
    return torques
