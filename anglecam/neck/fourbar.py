"""Four-bar kinematics of the nodding mechanism, Eqs. (1)-(2) of the paper, exact in both directions.

The servo turns the crank AC about A, the coupler CD pulls the rocker BD, and the rocker turns with the head about
the shaft B. θ_s is the angle of the crank at A, from the line A→B; θ_f the angle of the rocker at B, from the line
B→A. With B to the right of A both joints C and D lie above that line.

Eqs. (1)-(2) as printed use L3 as the ground link and then give 80°, 57° and 26° where Table 3 and Fig. 4 have 70°,
45° and 20°. The ground link L5 = 55 mm and the coupler L3 = 41 mm give the table, and are used here.

For a given crank angle the links close in two ways, which mirror each other in the diagonal BC; for a given rocker
angle they mirror each other in the diagonal AD. In both cases "open" is the branch of the paper, Fig. 3, and "crossed"
the other:

    θ_f = β ± α            + open: D beyond the line B→C, seen along growing θ_f
    θ_s = ∠BAD ± ∠DAC      + open: C beyond the line A→D, seen along growing θ_s

The branch of the crank and that of the rocker are independent. A crank that passes its dead centre moves to its crossed
branch while the rocker stays on its open branch; the rocker changes its branch only if the links are taken apart.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from anglecam.data.typing import Floats

Branch = Literal["open", "crossed"]

NEUTRAL_SERVO = math.radians(135.0)
"""θ_s at neutral, Table 3, rad."""

_SIDE: dict[Branch, float] = {"open": 1.0, "crossed": -1.0}


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


def head_angle(linkage: FourBar, theta_s: ArrayLike, branch: Branch = "open") -> Floats:
    """Return the rocker angle for a crank angle, Eqs. (1)-(2).

    Parameters
    ----------
    linkage : FourBar
        Link lengths, m.
    theta_s : array_like
        Crank angle, rad.
    branch : {"open", "crossed"}
        Side of the line B→C that D is on.

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
    # atan2 instead of the arcsine of Eq. (2): equal while BC leans towards A, and correct beyond.
    beta = np.arctan2(r * np.sin(servo), L5 - r * np.cos(servo))
    return np.asarray(beta + _SIDE[branch] * _corner(lam, L6, L3, "crank", servo))


def servo_angle(linkage: FourBar, theta_f: ArrayLike, branch: Branch = "open") -> Floats:
    """Return the crank angle for a rocker angle: Eq. (2) inverted, in closed form.

    Parameters
    ----------
    linkage : FourBar
        Link lengths, m.
    theta_f : array_like
        Rocker angle, rad; a negative one puts D below the line A→B, the rocker's crossed position in the paper's neck.
    branch : {"open", "crossed"}
        Side of the line A→D that C is on.

    Returns
    -------
    ndarray
        θ_s, rad; for rocker angles in (0, π) from 0 to 2π if open and from −π to π if crossed, both continuous.

    Raises
    ------
    ValueError
        If the links cannot close at one of the angles.
    """
    rocker = np.asarray(theta_f, dtype=float)
    r, L3, L5, L6 = linkage.crank, linkage.coupler, linkage.ground, linkage.rocker
    diagonal = np.sqrt(L5**2 + L6**2 - 2 * L5 * L6 * np.cos(rocker))  # AD
    towards_d = np.arctan2(L6 * np.sin(rocker), L5 - L6 * np.cos(rocker))
    return np.asarray(towards_d + _SIDE[branch] * _corner(diagonal, r, L3, "rocker", rocker))


def joints(linkage: FourBar, theta_f: ArrayLike, branch: Branch = "open") -> dict[str, Floats]:
    """Return the positions of the four joints for a rocker angle, with the shaft B at the origin.

    Parameters
    ----------
    linkage : FourBar
        Link lengths, m.
    theta_f : array_like
        Rocker angle, rad.
    branch : {"open", "crossed"}
        Side of the line A→D that C is on.

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
    servo = servo_angle(linkage, rocker, branch)
    B = np.zeros((*rocker.shape, 2))
    A = B + [-linkage.ground, 0.0]
    C = A + linkage.crank * np.stack([np.cos(servo), np.sin(servo)], axis=-1)
    D = B + linkage.rocker * np.stack([-np.cos(rocker), np.sin(rocker)], axis=-1)
    return {"A": A, "B": B, "C": C, "D": D}


def reach(linkage: FourBar) -> tuple[float, float]:
    """Return the smallest and largest rocker angle from the line B→A, on either side, at which the links close, rad.

    Returns
    -------
    tuple of float
        Between 0 and π. A rocker that reaches 0 or π passes through the line there.

    Raises
    ------
    ValueError
        If they close at no angle.
    """
    return _spread(linkage.ground, linkage.rocker, linkage.crank, linkage.coupler)


def crank_reach(linkage: FourBar) -> tuple[float, float]:
    """Return the smallest and largest crank angle from the line A→B, on either side, at which the links close, rad.

    Returns
    -------
    tuple of float
        Between 0 and π. A crank that reaches 0 or π passes through the line there; a crank that reaches both turns
        fully.

    Raises
    ------
    ValueError
        If they close at no angle.
    """
    return _spread(linkage.ground, linkage.crank, linkage.rocker, linkage.coupler)


def _spread(ground: float, turning: float, across: float, coupler: float) -> tuple[float, float]:
    """Return the range of a link's angle from the ground that the other two links can span, rad."""

    def angle_at(diagonal: float) -> float:
        return math.acos(min(1.0, max(-1.0, (ground**2 + turning**2 - diagonal**2) / (2 * ground * turning))))

    low, high = angle_at(abs(coupler - across)), angle_at(coupler + across)
    if not low < high:
        raise ValueError("the four links cannot close at any angle")
    return low, high


def _corner(first: Floats, second: float, opposite: float, turned: str, at: Floats) -> Floats:
    """Return the angle between two sides of a triangle, by the law of cosines."""
    cosine = np.asarray((first**2 + second**2 - opposite**2) / (2 * first * second))
    open_at = np.abs(cosine) > 1 + 1e-12
    if np.any(open_at):
        angle = math.degrees(float(np.atleast_1d(at)[np.atleast_1d(open_at)][0]))
        raise ValueError(f"the four links cannot close with the {turned} at {angle:.1f}°")
    return np.asarray(np.arccos(np.clip(cosine, -1.0, 1.0)))
