"""Velocity and acceleration of an angle, frame by frame, with their standard uncertainties."""

from __future__ import annotations

from dataclasses import dataclass

from anglecam.data.typing import Floats


@dataclass(frozen=True)
class Derivatives:
    """Derivatives of an angle with respect to time; arrays of length n, NaN where the angle is not measured."""

    velocity: Floats
    """rad/s."""
    velocity_sigma: Floats
    """Standard uncertainty of ``velocity``, rad/s."""
    acceleration: Floats
    """rad/s²."""
    acceleration_sigma: Floats
    """Standard uncertainty of ``acceleration``, rad/s²."""
