"""What was commanded, over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anglecam.data.typing import Floats


@dataclass(frozen=True)
class Command:
    """A piecewise constant command, each value held until the next; arrays of length m."""

    time: Floats
    """Instants of the rows, s on the clip's clock, strictly increasing."""
    angle: Floats
    """Commanded head angle from neutral, rad."""

    def first_change(self) -> float | None:
        """Return the instant (s) of the first row that differs from the one before it, ``None`` if none does."""
        changes = np.flatnonzero(np.diff(self.angle) != 0.0)
        return float(self.time[changes[0] + 1]) if len(changes) else None

    def at(self, time: Floats) -> Floats:
        """Look the command up at ``time`` (s); before the first row the first value holds."""
        index = np.searchsorted(self.time, time, side="right") - 1
        return self.angle[np.maximum(index, 0)]
