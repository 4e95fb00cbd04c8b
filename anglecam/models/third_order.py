"""The third-order model with two zeros, the form of the paper's SYS2 (Eq. (36)).

    θ(s)/U(s) = (n2·s² + n1·s + n0) / (s³ + d2·s² + d1·s + d0)

in observer form, so that the first state is the angle itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from anglecam.data.camera_evidence import UNKNOWN_VIEW, View
from anglecam.data.command import NO_COMMAND, Command
from anglecam.data.typing import Floats

MAX_STEP = 0.004
"""Longest step of the series, s; `ThirdOrder.upper` keeps it stable."""


@njit(
    "float64[::1](float64[::1], float64[::1], float64[::1], float64[::1], float64[::1], float64[::1], float64)",
    cache=True,
)
def _integrate(time, state, switches, values, n, d, max_step):  # type: ignore[no-untyped-def]  # compiled
    x, y, z = state[0], state[1], state[2]
    angle = np.empty(len(time))
    angle[0] = x
    k, m, now = 0, len(switches), time[0]
    while k + 1 < m and switches[k + 1] <= now:
        k += 1
    for i in range(1, len(time)):
        while now < time[i]:
            stop = time[i]
            if k + 1 < m and switches[k + 1] < stop:
                stop = switches[k + 1]
            steps = max(1, int(np.ceil((stop - now) / max_step)))
            h = (stop - now) / steps
            p, q, r = n[0] * values[k], n[1] * values[k], n[2] * values[k]
            for _ in range(steps):
                # a linear system under a constant input: the Taylor series of its exact step, to fourth order
                dx, dy, dz = y - d[0] * x + p, z - d[1] * x + q, r - d[2] * x
                factor = h
                for order in range(2, 6):
                    x, y, z = x + factor * dx, y + factor * dy, z + factor * dz
                    dx, dy, dz = dy - d[0] * dx, dz - d[1] * dx, -d[2] * dx
                    factor *= h / order
            now = stop
            while k + 1 < m and switches[k + 1] <= now:
                k += 1
        angle[i] = x
    return angle


@dataclass(frozen=True)
class ThirdOrder:
    """Third-order plant with zeros."""

    driven: bool = True
    """Whether any recording has a command; a free swing does not determine the numerator."""

    states = 3
    """Unknown initial states of a recording: angle (rad) and the two other states of the observer form."""

    @property
    def names(self) -> tuple[str, ...]:
        """Parameters in their order, as result files name them: denominator, then numerator."""
        return ("d2_per_s", "d1_per_s2", "d0_per_s3", "n2_per_s", "n1_per_s2", "n0_per_s3")[: self._count]

    @property
    def lower(self) -> Floats:
        """Lower bounds, SI."""
        return np.array([-100.0, -1e4, -1e6, -1e4, -1e6, -1e8])[: self._count]

    @property
    def upper(self) -> Floats:
        """Upper bounds, SI; below the limit of stability of the series."""
        return np.array([600.0, 2e5, 2e7, 1e4, 1e6, 1e8])[: self._count]

    @property
    def scales(self) -> Floats:
        """Magnitudes, SI, that scale the steps of difference quotients."""
        return np.array([1.0, 10.0, 1e3, 1.0, 10.0, 1e3])[: self._count]

    @property
    def to_file(self) -> Floats:
        """Factors from SI to the units in `names`."""
        return np.ones(self._count)

    @property
    def _count(self) -> int:
        return 6 if self.driven else 3

    def predict(
        self, parameters: Floats, time: Floats, command: Command | None, state: Floats, view: View = UNKNOWN_VIEW
    ) -> Floats:
        """Return the (n,) angle, rad, of a free run; see `anglecam.models.plant.Plant.run`."""
        held = NO_COMMAND if command is None else command.held()
        numerator = parameters[3:] if self.driven else np.zeros(3)
        switches, values = np.ascontiguousarray(held.time), np.ascontiguousarray(held.angle)
        return _integrate(np.ascontiguousarray(time), state, switches, values, numerator, parameters[:3], MAX_STEP)
