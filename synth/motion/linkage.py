"""The exact four-bar between servo and head, as functions of the head's angle from neutral.

The head's angle is θ = θ_f0 − θ_f, positive upwards (Table 3: Δθ = 45° − θ_f); the crank's is θ_s − θ_s0. Their ratio
γ = dθ_f/dθ_s is the slope of Fig. 4 at one point. It follows from differentiating |CD|² = L3² along the motion:

    γ = (C − D)·dC/dθ_s / (C − D)·dD/dθ_f

At either end of the reach crank and coupler are collinear: γ vanishes there like a square root.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Chebyshev

from anglecam.neck import FourBar, head_angle, reach, servo_angle, straight_line
from synth.spec import NEUTRAL_SERVO

STRAIGHT_FROM, STRAIGHT_TO = math.radians(60.0), math.radians(220.0)
"""Crank angles over which the paper fits its straight line, Fig. 4, rad."""

SERIES_DEGREE = 96
"""Degree of the Chebyshev series of Γ; the paper's linkage needs about half of it for 1e-15 rad."""


class Ratio(NamedTuple):
    """The linkage at one angle of the head."""

    crank: float
    """θ_s − θ_s0, rad."""
    gamma: float
    bend: float
    """dγ/dθ, 1/rad."""


NOWHERE = Ratio(math.nan, math.nan, math.nan)


@dataclass(frozen=True)
class Transmission:
    """A four-bar with its neutral position."""

    linkage: FourBar
    neutral_rocker: float
    """θ_f0, rad."""
    neutral_crank: float
    """θ_s0, rad."""

    @cached_property
    def reach(self) -> tuple[float, float]:
        """Return the lowest and highest θ at which the links close, rad."""
        low, high = reach(self.linkage)
        return self.neutral_rocker - high, self.neutral_rocker - low

    @cached_property
    def neutral_gamma(self) -> float:
        """Return γ at neutral."""
        return self.at(0.0).gamma

    def at(self, theta: float) -> Ratio:
        """Return the crank's angle and γ; NaN where the links do not close or γ is 0 or infinite."""
        low, high = self.reach
        if not low < theta < high:
            return NOWHERE
        rocker = self.neutral_rocker - theta
        crank = float(servo_angle(self.linkage, rocker))
        r, L6 = self.linkage.crank, self.linkage.rocker
        cos_s, sin_s, cos_f, sin_f = math.cos(crank), math.sin(crank), math.cos(rocker), math.sin(rocker)
        x, y = -self.linkage.ground + r * cos_s + L6 * cos_f, r * sin_s - L6 * sin_f  # C − D
        along_c = r * (-x * sin_s + y * cos_s)
        along_d = L6 * (x * sin_f + y * cos_f)
        if along_c == 0.0 or along_d == 0.0:
            return NOWHERE
        gamma = along_c / along_d
        # second derivative: d(C − D)/dθ_s, and with it the derivatives of numerator and denominator
        dx, dy = -r * sin_s - gamma * L6 * sin_f, r * cos_s - gamma * L6 * cos_f
        c_changes = r * (-dx * sin_s + dy * cos_s) - r * (x * cos_s + y * sin_s)
        d_changes = L6 * (dx * sin_f + dy * cos_f) + gamma * L6 * (x * cos_f - y * sin_f)
        per_crank = (c_changes - gamma * d_changes) / along_d
        return Ratio(crank - self.neutral_crank, gamma, -per_crank / gamma)

    def gathered(self, theta: float) -> float:
        """Return Γ(θ) = ∫γ dθ from neutral, rad: the paper's θ_a = γΔθ of Eqs. (3) and (12) for a variable γ."""
        low, high = self.reach
        if not low < theta < high:
            return math.nan
        x = 2 / math.pi * math.acos((low + high - 2 * theta) / (high - low)) - 1
        b1 = b2 = 0.0
        for coefficient in self._series[:0:-1]:  # Clenshaw
            b1, b2 = coefficient + 2 * x * b1 - b2, b1
        return self._series[0] + x * b1 - b2

    @cached_property
    def _series(self) -> list[float]:
        """Return the Chebyshev series of Γ in ξ, θ = mid − half·cos ξ: the square roots at the ends are smooth in ξ."""
        low, high = self.reach
        mid, half = (low + high) / 2, (high - low) / 2

        def per_xi(xi: np.ndarray) -> np.ndarray:
            return np.array([self.at(mid - half * math.cos(one)).gamma * half * math.sin(one) for one in xi])

        slope = Chebyshev.interpolate(per_xi, SERIES_DEGREE, domain=[0.0, math.pi])
        if not np.abs(slope.coef[-8:]).max() < 1e-11 * np.abs(slope.coef).max():
            raise ValueError("the crank has a dead centre within the linkage's reach")
        gathered = slope.integ(lbnd=math.acos(mid / half))
        return [float(coefficient) for coefficient in gathered.trim(1e-17).coef]


@lru_cache(maxsize=16)
def transmission(linkage: FourBar) -> Transmission:
    """Return a linkage with its neutral position of Table 3.

    Raises
    ------
    ValueError
        If the links cannot close there.
    """
    rocker = float(head_angle(linkage, NEUTRAL_SERVO))
    return Transmission(linkage, rocker, float(servo_angle(linkage, rocker)))


def straight_gamma(linkage: FourBar) -> float:
    """Return the slope of the paper's straight line, Eq. (3) and Fig. 4, over the reachable part of 60°–220°."""
    ends = servo_angle(linkage, np.array(reach(linkage)))
    return straight_line(linkage, max(STRAIGHT_FROM, ends.min()), min(STRAIGHT_TO, ends.max())).slope
