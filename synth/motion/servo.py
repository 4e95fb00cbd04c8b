"""The servo's torque over its error: straight lines with kinks, where it has a dead zone or a limit.

    servo(e) = gain·dz(e),  dz(e) = sgn(e)·max(|e| − width, 0),  and never beyond ±limit

With error e = v − feedback and without either it is gain·e.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass


@dataclass(frozen=True)
class Servo:
    """Sectors of error, each with its straight line."""

    kinks: tuple[float, ...]
    """Errors between one sector and the next, ascending."""
    lines: tuple[tuple[float, float], ...]
    """Of each sector: slope and offset of the torque, as angular acceleration of the head."""

    def sector(self, error: float) -> int:
        """Where an error lies."""
        return bisect_right(self.kinks, error)

    def torque(self, sector: int, error: float) -> float:
        """Angular acceleration, rad/s², along the line of a sector."""
        slope, offset = self.lines[sector]
        return slope * error + offset


def build_servo(gain: float, width: float | None, limit: float | None) -> Servo:
    """Lay out the sectors.

    Parameters
    ----------
    gain : float
        rad/s² for each unit of error.
    width : float or None
        Half the dead zone, unit of error.
    limit : float or None
        rad/s².
    """
    kinks: list[float] = []
    lines = [(gain, 0.0)]
    if width is not None:
        kinks = [-width, width]
        lines = [(gain, gain * width), (0.0, 0.0), (gain, -gain * width)]
    if limit is not None:
        full = (width or 0.0) + limit / gain
        kinks = [-full, *kinks, full]
        lines = [(0.0, -limit), *lines, (0.0, limit)]
    return Servo(tuple(kinks), tuple(lines))
