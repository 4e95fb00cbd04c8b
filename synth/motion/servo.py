"""The servo's torque as a piecewise linear function of its error, with a dead zone and a limit.

    servo(e) = gain·dz(e) limited to ±limit,  dz(e) = sgn(e)·max(|e| − width, 0)

The error is e = v − feedback. Without dead zone and limit the torque is gain·e. The limits may fall with speed, as
those of a motor on a fixed voltage do: limit·(1 − θ̇/ω0) upwards and −limit·(1 + θ̇/ω0) downwards.
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
    sag: float = 0.0
    """By how much both limits fall with speed, rad/s² per rad/s; the first and last sectors are then the limits."""
    gain: float = 1.0
    """rad/s² per unit of error."""

    def kink(self, number: int, omega: float) -> float:
        """Return the error at a border between sectors, at a speed, rad/s."""
        at_rest = self.kinks[number]
        return at_rest - self.sag * omega / self.gain if number in (0, len(self.kinks) - 1) else at_rest

    def sector(self, error: float, omega: float) -> int:
        """Return the sector of an error at a speed, rad/s."""
        return bisect_right([self.kink(number, omega) for number in range(len(self.kinks))], error)

    def torque(self, sector: int, error: float, omega: float) -> float:
        """Return the angular acceleration, rad/s², on the line of a sector at a speed, rad/s."""
        slope, offset = self.lines[sector]
        limited = self.sag != 0.0 and sector in (0, len(self.kinks))
        return slope * error + offset - (self.sag * omega if limited else 0.0)


def build_servo(
    gain: float, width: float | None, limit: float | None, no_load: float | None = None, *, divided: bool = False
) -> Servo:
    """Return a servo's sectors.

    Parameters
    ----------
    gain : float
        rad/s² per unit of error.
    width : float or None
        Half-width of the dead zone, in units of the error; ``None`` without one.
    limit : float or None
        Limit of the torque, rad/s²; ``None`` without one.
    no_load : float or None
        Speed at which the limit has fallen to zero, rad/s; ``None`` if it does not depend on speed.
    divided : bool
        Whether a sector ends where the torque changes sign, for a friction that depends on its magnitude.
    """
    kinks: list[float] = []
    lines = [(gain, 0.0)]
    if width is not None:
        kinks = [-width, width]
        lines = [(gain, gain * width), (0.0, 0.0), (gain, -gain * width)]
    elif divided:
        kinks, lines = [0.0], [(gain, 0.0), (gain, 0.0)]
    if limit is not None:
        full = (width or 0.0) + limit / gain
        kinks = [-full, *kinks, full]
        lines = [(0.0, -limit), *lines, (0.0, limit)]
    sag = limit / no_load if limit is not None and no_load is not None else 0.0
    return Servo(tuple(kinks), tuple(lines), sag, gain)
