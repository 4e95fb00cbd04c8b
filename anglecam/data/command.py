"""The command over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anglecam.data.typing import Floats


@dataclass(frozen=True)
class Command:
    """A piecewise constant command, each value held until the next; arrays of length m.

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

    def first_change(self) -> float | None:
        """Return the instant (s) of the first row that differs from the row before it; ``None`` if no row does."""
        changes = np.flatnonzero(np.diff(self.angle) != 0.0)
        return float(self.time[changes[0] + 1]) if len(changes) else None

    def at(self, time: Floats) -> Floats:
        """Return the command, rad, at ``time`` (s); before the first row the first value holds."""
        index = np.searchsorted(self.time, time, side="right") - 1
        return self.angle[np.maximum(index, 0)]
