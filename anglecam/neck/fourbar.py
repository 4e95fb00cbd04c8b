"""Four-bar kinematics of the nodding mechanism, Eqs. (1)-(3) of the paper, exact in both directions.

The servo turns the crank AC about A, the coupler CD pulls the rocker BD, and the rocker turns with the head about
the shaft B. θ_s is the angle of the crank at A, from the line A→B; θ_f the angle of the rocker at B, from the line
B→A. With B to the right of A both joints C and D lie above that line.

Eqs. (1)-(2) as printed take L3 for the ground link and then give 80°, 57° and 26° where Table 3 and Fig. 4 say 70°,
45° and 20°. The table follows with the ground link L5 = 55 mm and the coupler L3 = 41 mm, which is what stands here.
Eq. (3) is printed the wrong way round: −0.36 is dθ_f/dθ_s, the slope of Fig. 4.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class FourBar:
    """Link lengths in metres; the defaults are the paper's."""

    ground: float = 0.055
    """A to B, L5."""
    coupler: float = 0.041
    """C to D, L3."""
    rocker: float = 0.059
    """B to D, L6."""
    crank: float = 0.025
    """A to C, r."""


@dataclass(frozen=True)
class StraightLine:
    """θ_f ≈ slope·θ_s + intercept, the dashed line of Fig. 4."""

    slope: float
    """γ, without unit."""
    intercept: float
    """rad."""
    r_squared: float


def head_angle(linkage: FourBar, theta_s: ArrayLike) -> Floats:
    """Angle of the rocker for an angle of the crank, Eqs. (1)-(2).

    Parameters
    ----------
    linkage : FourBar
        Link lengths, m.
    theta_s : array_like
        Crank angle, rad.

    Returns
    -------
    ndarray
        θ_f, rad.

    Raises
    ------
    ValueError
        If the links cannot close at one of the angles.
    """
    servo = np.asarray(theta_s, dtype=float)
    r, L3, L5, L6 = linkage.crank, linkage.coupler, linkage.ground, linkage.rocker
    lam = np.sqrt(r**2 + L5**2 - 2 * r * L5 * np.cos(servo))  # Eq. (1), BC
    # atan2 in place of Eq. (2)'s arcsine: the same while BC leans towards A, right beyond it.
    beta = np.arctan2(r * np.sin(servo), L5 - r * np.cos(servo))
    return np.asarray(beta + _corner(lam, L6, L3, "crank", servo))


def servo_angle(linkage: FourBar, theta_f: ArrayLike) -> Floats:
    """Angle of the crank for an angle of the rocker: Eq. (2) solved the other way, in closed form.

    Of the two positions of the crank it takes the one of Fig. 3, beyond the line A→D.

    Parameters
    ----------
    linkage : FourBar
        Link lengths, m.
    theta_f : array_like
        Rocker angle, rad.

    Returns
    -------
    ndarray
        θ_s, rad, between 0 and 2π.

    Raises
    ------
    ValueError
        If the links cannot close at one of the angles.
    """
    rocker = np.asarray(theta_f, dtype=float)
    r, L3, L5, L6 = linkage.crank, linkage.coupler, linkage.ground, linkage.rocker
    diagonal = np.sqrt(L5**2 + L6**2 - 2 * L5 * L6 * np.cos(rocker))  # AD
    towards_d = np.arctan2(L6 * np.sin(rocker), L5 - L6 * np.cos(rocker))
    return np.asarray(towards_d + _corner(diagonal, r, L3, "rocker", rocker))


def joints(linkage: FourBar, theta_f: ArrayLike) -> dict[str, Floats]:
    """Place the four joints for an angle of the rocker, with the shaft B at the origin.

    Parameters
    ----------
    linkage : FourBar
        Link lengths, m.
    theta_f : array_like
        Rocker angle, rad.

    Returns
    -------
    dict of str to ndarray
        Joints ``A``, ``B``, ``C``, ``D``, each of shape (…, 2), m.

    Raises
    ------
    ValueError
        If the links cannot close at one of the angles.
    """
    rocker = np.asarray(theta_f, dtype=float)
    servo = servo_angle(linkage, rocker)
    B = np.zeros((*rocker.shape, 2))
    A = B + [-linkage.ground, 0.0]
    C = A + linkage.crank * np.stack([np.cos(servo), np.sin(servo)], axis=-1)
    D = B + linkage.rocker * np.stack([-np.cos(rocker), np.sin(rocker)], axis=-1)
    return {"A": A, "B": B, "C": C, "D": D}


def reach(linkage: FourBar) -> tuple[float, float]:
    """Smallest and largest rocker angle at which the links close, rad.

    Raises
    ------
    ValueError
        If they close at none.
    """

    def rocker_at(diagonal: float) -> float:
        L5, L6 = linkage.ground, linkage.rocker
        return math.acos(min(1.0, max(-1.0, (L5**2 + L6**2 - diagonal**2) / (2 * L5 * L6))))

    shortest, longest = abs(linkage.coupler - linkage.crank), linkage.coupler + linkage.crank
    low, high = rocker_at(shortest), rocker_at(longest)
    if not low < high:
        raise ValueError("the four links cannot close at any angle")
    return low, high


def straight_line(linkage: FourBar, low: float, high: float) -> StraightLine:
    """Fit the straight line of Fig. 4 and Eq. (3) to θ_f(θ_s), every tenth of a degree.

    Parameters
    ----------
    linkage : FourBar
        Link lengths, m.
    low, high : float
        Range of θ_s, rad; the paper's operation is 60° to 220°.

    Returns
    -------
    StraightLine
        Slope γ = dθ_f/dθ_s, intercept and coefficient of determination.

    Raises
    ------
    ValueError
        If the links cannot close somewhere in the range.
    """
    servo = np.linspace(low, high, 1 + round(math.degrees(high - low) / 0.1))
    head = head_angle(linkage, servo)
    slope, intercept = np.polyfit(servo, head, 1)
    left = head - (slope * servo + intercept)
    return StraightLine(float(slope), float(intercept), float(1 - left.var() / head.var()))


def _corner(first: Floats, second: float, opposite: float, turned: str, at: Floats) -> Floats:
    """Angle between two sides of a triangle, by the law of cosines."""
    cosine = np.asarray((first**2 + second**2 - opposite**2) / (2 * first * second))
    open_at = np.abs(cosine) > 1 + 1e-12
    if np.any(open_at):
        angle = math.degrees(float(np.atleast_1d(at)[np.atleast_1d(open_at)][0]))
        raise ValueError(f"the four links cannot close with the {turned} at {angle:.1f}°")
    return np.asarray(np.arccos(np.clip(cosine, -1.0, 1.0)))
