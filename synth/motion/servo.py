"""The servo's torque as a piecewise linear function of its error, with a dead zone and a limit.

    servo(e) = gain·dz(e) limited to ±limit,  dz(e) = sgn(e)·max(|e| − width, 0)

The error is e = v − feedback. Without dead zone and limit the torque is gain·e.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass


@dataclass(frozen=True)
class Servo:
    """Intervals of the error, called sectors, each with a straight line."""

    kinks: tuple[float, ...]
    """Errors at the borders between sectors, ascending."""
    lines: tuple[tuple[float, float], ...]
    """For each sector the slope and offset of the torque, as angular acceleration of the head."""

    def sector(self, error: float) -> int:
        """Return the sector of an error."""
        return bisect_right(self.kinks, error)

    def torque(self, sector: int, error: float) -> float:
        """Return the angular acceleration, rad/s², on the line of a sector."""
        slope, offset = self.lines[sector]
        return slope * error + offset


def build_servo(gain: float, width: float | None, limit: float | None) -> Servo:
    """Return a servo's sectors.

    Parameters
    ----------
    gain : float
        rad/s² per unit of error.
    width : float or None
        Half-width of the dead zone, in units of the error; ``None`` without one.
    limit : float or None
        Limit of the torque, rad/s²; ``None`` without one.
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
