"""The command over time: held from row to row, or the straight lines between samples."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from anglecam.data.typing import Floats

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

    @property
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

    def at(self, time: Floats) -> Floats:
        """Return the command, rad, at ``time`` (s); before the first row the first value holds."""
        index = np.searchsorted(self.time, time, side="right") - 1
        level = self.angle[np.maximum(index, 0)]
        if self.slope is None:
            return level
        return np.asarray(level + np.where(index >= 0, self.slope[index] * (time - self.time[index]), 0.0))


NO_COMMAND = Command(np.zeros(1), np.zeros(1))
"""The command of a free swing, for a model that needs one."""
