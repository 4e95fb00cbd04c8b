"""Change one quantity of a neck, named by the paper's symbol.

In the paper L6 is both the rocker of the four-bar and the arm of the spring, and other quantities follow it: "as L6
changes, L3 also changes and therefore the geometric parameter γ is changed accordingly". Here the chain still closes at
neutral, θ_s = 135°, at the head angle of the given linkage, so the coupler is the distance between the joints C and D
there; γ is the slope of the line fitted over the nod, as in Fig. 4.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from anglecam.neck.fourbar import NEUTRAL_SERVO, FourBar, head_angle, reach, servo_angle
from anglecam.neck.parameters import NeckParameters
from anglecam.neck.transmission import straight_line

NOD = math.radians(25.0)
"""Nod to either side of neutral, Table 3, rad."""


@dataclass(frozen=True)
class NeckQuantity:
    """One quantity of a neck."""

    symbol: str
    """The paper's symbol."""
    name: str
    unit: str
    read: Callable[[NeckParameters], float]
    changed: Callable[[NeckParameters, float], NeckParameters]
    """Return a neck with another value, SI, and with every quantity that follows from it."""


def neutral_head(linkage: FourBar) -> float:
    """Return θ_f with the servo at neutral, rad."""
    return float(head_angle(linkage, NEUTRAL_SERVO))


def relinked(neck: NeckParameters, rocker: float) -> NeckParameters:
    """Return a neck with another L6: rocker, coupler and spring arm, and the γ that follows.

    Parameters
    ----------
    neck : NeckParameters
        The neck to change.
    rocker : float
        L6, m.

    Returns
    -------
    NeckParameters
        With a chain that closes at neutral. γ is fitted even if L6 is unchanged: −0.3604 for the paper's links, where
        the paper prints −0.36.

    Raises
    ------
    ValueError
        If the chain closes only at neutral.
    """
    old = neck.linkage
    linkage = replace(old, rocker=rocker, coupler=closing_coupler(old, rocker))
    arm = neck.spring.arm * rocker / old.rocker
    return replace(neck, linkage=linkage, spring=replace(neck.spring, arm=arm), gamma=nod_slope(linkage))


def closing_coupler(linkage: FourBar, rocker: float) -> float:
    """Return the L3 that closes the chain at neutral with another L6, m."""
    theta_f = neutral_head(linkage)
    across = linkage.ground - rocker * math.cos(theta_f) - linkage.crank * math.cos(NEUTRAL_SERVO)
    return math.hypot(across, rocker * math.sin(theta_f) - linkage.crank * math.sin(NEUTRAL_SERVO))


def nod_slope(linkage: FourBar, nod: float = NOD) -> float:
    """Return γ fitted over a nod to either side of neutral, as far as the links reach.

    Parameters
    ----------
    linkage : FourBar
        Link lengths, m.
    nod : float
        To either side, rad.

    Returns
    -------
    float
        dθ_f/dθ_s of the fitted line.

    Raises
    ------
    ValueError
        If the links close at no angle.
    """
    return straight_line(linkage, *nod_range(linkage, nod)).slope


def nod_range(linkage: FourBar, nod: float = NOD) -> tuple[float, float]:
    """Return the range of θ_s for a nod to either side of neutral, as far as the links reach; all in rad."""
    low, high = reach(linkage)
    middle = neutral_head(linkage)
    ends = servo_angle(linkage, np.clip([middle + nod, middle - nod], low, high))
    return float(ends.min()), float(ends.max())


def _of(part: str, attribute: str, symbol: str, name: str, unit: str) -> NeckQuantity:
    """Return the quantity that is an attribute of a part of the neck."""

    def read(neck: NeckParameters) -> float:
        return float(getattr(getattr(neck, part), attribute))

    def changed(neck: NeckParameters, value: float) -> NeckParameters:
        return replace(neck, **{part: replace(getattr(neck, part), **{attribute: value})})

    return NeckQuantity(symbol, name, unit, read, changed)


PARAMETERS: dict[str, NeckQuantity] = {
    p.symbol: p
    for p in (
        _of("servo", "sensor_gain", "h", "sensor gain", "V/rad"),
        _of("servo", "motor_constant", "K_m", "motor constant", "N·m/A"),
        _of("servo", "amplifier_gain", "G_a", "amplifier gain", "V/V"),
        _of("servo", "gear_ratio", "G_g", "gear ratio", "1"),
        _of("servo", "output_impedance", "R_a", "output impedance", "Ω"),
        _of("servo", "rotor_inertia", "J_r", "rotor inertia", "kg·m²"),
        _of("head", "mass", "M_h", "mass of the head", "kg"),
        _of("head", "centre_of_mass", "L", "distance of the centre of mass", "m"),
        _of("head", "own_inertia", "J_cg", "own inertia of the head", "kg·m²"),
        _of("head", "neutral", "theta_0", "neutral angle", "rad"),
        _of("spring", "rate", "K", "spring rate", "N/m"),
        _of("spring", "base", "L_2", "base of the spring", "m"),
        NeckQuantity("L_6", "link length", "m", lambda neck: neck.linkage.rocker, relinked),
        NeckQuantity("C", "damping", "N·m·s", lambda neck: neck.damping, lambda neck, v: replace(neck, damping=v)),
        NeckQuantity("gamma", "linkage slope", "1", lambda neck: neck.gamma, lambda neck, v: replace(neck, gamma=v)),
    )
}
"""The quantities by symbol."""
