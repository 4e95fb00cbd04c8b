"""Transmission of the four-bar: its slope and Eq. (3), its limits, and its transmission angle.

The rate of the rocker follows from |CD|² = L3², which holds along the motion. With e = C − D and C', D' the derivatives
of C and D by the angle of the link that each is on,

    γ  = dθ_f/dθ_s   = e·C' / e·D'
    dγ/dθ_s          = (|C' − γD'|² − e·AC + γ²·e·BD) / e·D'

which is exact on every branch. Eq. (3), Δθ_s = γ·Δθ_f, is printed inverted: −0.36 is dθ_f/dθ_s, the slope of Fig. 4.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from anglecam.data.typing import Floats
from anglecam.neck.fourbar import Branch, FourBar, crank_reach, head_angle, reach, servo_angle

GrashofClass = Literal["crank-rocker", "rocker-crank", "double-crank", "double-rocker", "triple-rocker", "change-point"]


@dataclass(frozen=True)
class StraightLine:
    """θ_f ≈ slope·θ_s + intercept, the dashed line of Fig. 4."""

    slope: float
    """γ, without unit."""
    intercept: float
    """rad."""
    r_squared: float


@dataclass(frozen=True)
class LinkageLimits:
    """Ranges of rocker and crank with the rocker open and the crank on one branch."""

    kind: GrashofClass
    """Grashof's class, crank first."""
    rocker: tuple[float, float]
    """Lowest and highest θ_f, rad. With the rocker crossed θ_f and θ_s have the opposite sign."""
    crank: tuple[float, float]
    """Lowest and highest θ_s, rad. For a crank-rocker these are the dead centres, where crank and coupler lie in one
    line, the rocker turns back, and the crank continues on its other branch."""


@dataclass(frozen=True)
class TransmissionAngle:
    """Angle between coupler and rocker at one angle of the crank."""

    theta_s: float
    """rad."""
    mu: float
    """rad, from 0 to π; at π/2 the whole force of the coupler turns the rocker."""


def slope(linkage: FourBar, theta_s: ArrayLike, branch: Branch = "open") -> Floats:
    """Return the slope of rocker over crank, γ = dθ_f/dθ_s, exact.

    Parameters
    ----------
    linkage : FourBar
        Link lengths, m.
    theta_s : array_like
        Crank angle, rad.
    branch : {"open", "crossed"}
        Branch of the rocker, as in `head_angle`.

    Returns
    -------
    ndarray
        γ, without unit: 0 at a dead centre of the crank, unbounded where coupler and rocker lie in one line.

    Raises
    ------
    ValueError
        If the links cannot close at one of the angles.
    """
    return _rates(linkage, theta_s, branch)[0]


def bend(linkage: FourBar, theta_s: ArrayLike, branch: Branch = "open") -> Floats:
    """Return the change of the slope along the motion, dγ/dθ_s, exact.

    Parameters
    ----------
    linkage, theta_s, branch
        As for `slope`.

    Returns
    -------
    ndarray
        dγ/dθ_s, 1/rad.

    Raises
    ------
    ValueError
        If the links cannot close at one of the angles.
    """
    return _rates(linkage, theta_s, branch)[1]


def straight_line(linkage: FourBar, low: float, high: float) -> StraightLine:
    """Fit the straight line of Fig. 4 and Eq. (3) to θ_f(θ_s), sampled at every tenth of a degree.

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
    gamma, intercept = np.polyfit(servo, head, 1)
    residuals = head - (gamma * servo + intercept)
    return StraightLine(float(gamma), float(intercept), float(1 - residuals.var() / head.var()))


def grashof(linkage: FourBar) -> GrashofClass:
    """Return the Grashof class of the linkage: which links can turn fully.

    Parameters
    ----------
    linkage : FourBar
        Link lengths, m.

    Returns
    -------
    str
        The crank is named first: in a "crank-rocker" the crank turns fully and the rocker swings. A "change-point"
        linkage can fold flat, where its branches meet.
    """
    links = asdict(linkage)
    shortest, *between, longest = sorted(links, key=lambda name: links[name])
    outer, inner = links[shortest] + links[longest], sum(links[name] for name in between)
    if math.isclose(outer, inner, rel_tol=1e-12):
        return "change-point"
    if outer > inner:
        return "triple-rocker"
    kinds: dict[str, GrashofClass] = {
        "crank": "crank-rocker",
        "rocker": "rocker-crank",
        "ground": "double-crank",
        "coupler": "double-rocker",
    }
    return kinds[shortest]


def limits(linkage: FourBar, branch: Branch = "open") -> LinkageLimits:
    """Return the ranges of crank and rocker between their toggle positions, with the rocker open.

    Parameters
    ----------
    linkage : FourBar
        Link lengths, m.
    branch : {"open", "crossed"}
        Branch of the crank, as in `servo_angle`.

    Returns
    -------
    LinkageLimits
        Class, range of the rocker and range of the crank.

    Raises
    ------
    ValueError
        If the links close at no angle.
    """
    low, high = reach(linkage)
    # where coupler and rocker lie in one line the crank turns back, which may happen within the range of the rocker
    ends = np.array(crank_reach(linkage))
    turns = head_angle(linkage, np.concatenate([ends, -ends]))
    turns = np.arctan2(np.sin(turns), np.cos(turns))
    rocker = np.concatenate([[low, high], turns[(turns > low) & (turns < high)]])
    crank = servo_angle(linkage, rocker, branch)
    return LinkageLimits(grashof(linkage), (low, high), (float(crank.min()), float(crank.max())))


def transmission_angle(linkage: FourBar, theta_s: ArrayLike) -> Floats:
    """Return the angle between coupler and rocker at D, which is equal on both branches.

    Parameters
    ----------
    linkage : FourBar
        Link lengths, m.
    theta_s : array_like
        Crank angle, rad.

    Returns
    -------
    ndarray
        μ, rad, from 0 to π.

    Raises
    ------
    ValueError
        If the links cannot close at one of the angles.
    """
    servo = np.asarray(theta_s, dtype=float)
    e, _, D = _coupler(linkage, servo, head_angle(linkage, servo))
    along, across = _dot(e, D), e[0] * D[1] - e[1] * D[0]
    return np.asarray(np.abs(np.arctan2(across, -along)))


def worst_transmission_angle(linkage: FourBar, low: float, high: float) -> TransmissionAngle:
    """Return where in a range of the crank the transmission angle is farthest from a right angle.

    μ grows with BC, and BC with the crank's angle from the line A→B, so only the ends of the range and the crossings of
    that line can be the worst.

    Parameters
    ----------
    linkage : FourBar
        Link lengths, m.
    low, high : float
        Range of θ_s, rad.

    Returns
    -------
    TransmissionAngle
        θ_s, and μ there.

    Raises
    ------
    ValueError
        If the links cannot close at one of those angles, or the range is empty.
    """
    if not low <= high:
        raise ValueError(f"the crank's range from {math.degrees(low):.1f}° to {math.degrees(high):.1f}° is empty")
    crossings = math.pi * np.arange(math.ceil(low / math.pi), math.floor(high / math.pi) + 1)
    servo = np.concatenate([[low, high], crossings])
    mu = transmission_angle(linkage, servo)
    worst = int(np.argmax(np.abs(mu - math.pi / 2)))
    return TransmissionAngle(float(servo[worst]), float(mu[worst]))


def _rates(linkage: FourBar, theta_s: ArrayLike, branch: Branch) -> tuple[Floats, Floats]:
    """Return γ and dγ/dθ_s."""
    servo = np.asarray(theta_s, dtype=float)
    e, C, D = _coupler(linkage, servo, head_angle(linkage, servo, branch))
    # the rocker's angle runs clockwise, the crank's counter-clockwise
    per_crank, per_rocker = np.stack([-C[1], C[0]]), np.stack([D[1], -D[0]])
    with np.errstate(divide="ignore", invalid="ignore"):
        gamma = _dot(e, per_crank) / _dot(e, per_rocker)
        drift = per_crank - gamma * per_rocker
        change = (_dot(drift, drift) - _dot(e, C) + gamma**2 * _dot(e, D)) / _dot(e, per_rocker)
    return gamma, change


def _coupler(linkage: FourBar, servo: Floats, rocker: Floats) -> tuple[Floats, Floats, Floats]:
    """Return D→C, A→C and B→D, components first, m."""
    C = linkage.crank * np.stack([np.cos(servo), np.sin(servo)])
    D = linkage.rocker * np.stack([-np.cos(rocker), np.sin(rocker)])
    ground = np.zeros_like(C)
    ground[0] = linkage.ground
    return C - D - ground, C, D


def _dot(first: Floats, second: Floats) -> Floats:
    return np.asarray((first * second).sum(axis=0))
