"""The command over time: held from row to row, or the straight lines between samples."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from anglecam.data.typing import Floats

SAMPLE = 0.01
"""s, between the instants at which a command is compared with itself to find its period."""
REPEATED = 0.02
"""Mean squared difference after a period, as a share of that between unrelated instants, up to which a command
repeats itself."""
PARTS = 8
"""Steps that stand for a straight line where a model takes held commands only."""


@dataclass(frozen=True)
class Command:
    """A piecewise linear command; arrays of length m. Without ``slope`` each value is held until the next.

    Examples
    --------
    >>> import numpy as np
    >>> command = Command(time=np.array([0.0, 1.0, 2.0]), angle=np.array([0.0, 0.0, 0.1]))
    >>> command.first_change()
    2.0
    >>> command.at(np.array([-1.0, 1.5, 2.0, 9.0]))
    array([0. , 0. , 0.1, 0.1])
    """

    time: Floats
    """Instants of the rows, s on the clip's clock, strictly increasing."""
    angle: Floats
    """Commanded angle from neutral, rad."""
    slope: Floats | None = field(default=None, repr=False)
    """Slope from each row to the next, rad/s, zero after the last; ``None`` where the values are held."""

    @cached_property
    def knots(self) -> Floats:
        """(3, m) instants, levels and slopes."""
        return np.stack([self.time, self.angle, np.zeros(len(self.time)) if self.slope is None else self.slope])

    def sampled(self) -> Command:
        """Return the straight lines between the rows, for rows that are samples of a continuous signal."""
        rise = np.diff(self.angle) / np.diff(self.time)
        return Command(self.time, self.angle, np.append(rise, 0.0))

    def held(self) -> Command:
        """Return a held command in place of straight lines: `PARTS` steps from row to row, each at its middle."""
        if self.slope is None:
            return self
        part = np.append(np.diff(self.time), 0.0)[:, None] * np.arange(PARTS) / PARTS
        middle = part + 0.5 * part[:, 1:2]
        time, angle = self.time[:, None] + part, self.angle[:, None] + self.slope[:, None] * middle
        return Command(np.append(time[:-1], self.time[-1]), np.append(angle[:-1], self.angle[-1]))

    def first_change(self) -> float | None:
        """Return the instant (s) at which the command first departs from a constant; ``None`` if it never does."""
        changes = np.flatnonzero(np.diff(self.angle) != 0.0)
        if len(changes) == 0:
            return None
        return float(self.time[changes[0] + (1 if self.slope is None else 0)])

    @cached_property
    def cycle(self) -> tuple[float, float] | None:
        """Period and instant at which the first one begins, s; ``None`` unless two or more follow each other."""
        begin = self.first_change()
        if begin is None:
            return None
        level = self.at(np.arange(begin, self.time[-1], SAMPLE))
        lags = np.arange(1, len(level) // 2 + 1)
        energy = 2.0 * float(np.var(level)) if len(lags) else 0.0
        if energy == 0.0:
            return None
        off = np.array([np.mean((level[lag:] - level[:-lag]) ** 2) for lag in lags]) / energy
        unlike = np.maximum.accumulate(off) > 0.5  # a slow command resembles itself a moment later
        found = np.flatnonzero(unlike & (off < REPEATED))
        if len(found) == 0:
            return None
        apart = np.flatnonzero(np.diff(found) > 1)
        first = found[: apart[0] + 1] if len(apart) else found
        return float(lags[first[np.argmin(off[first])]]) * SAMPLE, begin

    def at(self, time: Floats) -> Floats:
        """Return the command, rad, at ``time`` (s); before the first row the first value holds."""
        index = np.searchsorted(self.time, time, side="right") - 1
        level = self.angle[np.maximum(index, 0)]
        if self.slope is None:
            return level
        return np.asarray(level + np.where(index >= 0, self.slope[index] * (time - self.time[index]), 0.0))


NO_COMMAND = Command(np.zeros(1), np.zeros(1))
"""The command of a free swing, for a model that needs one."""
