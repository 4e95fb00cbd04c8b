"""Turning of the head: the RPRR mechanism of Fig. 2 (a), (c) and (d), and its thrust bearing, Eq. (4).

The crank of the servo turns about A (R), its pin C turns in a block (R) that slides along a slot (P) in the head's
plate, and the plate turns on the thrust bearing O (R). This is an inverted slider-crank, also called a crank and
slotted lever. Let s be the servo angle from neutral and φ the direction of the slot, both from the line O→A extended
beyond A, and let the centre line of the slot pass O at the distance e. Then

    r·sin(s − φ) = e + d·sin φ        d = OA, r = AC

which is the closure with the sliding distance eliminated. Its derivative is the slope dφ/ds = r·cos(s − φ)/x, where x
is the distance of the block along the slot from the foot of O.

The paper requires ±60° and prints no dimension. The defaults use its 25 mm servo horn as the crank and put the bearing
14 mm from the servo, inside the circle of the crank. There the mechanism has no dead centre, its slope stays within
0.64-0.76, and ±90° of the servo arm (Fig. 13) turn the head by ±60.8°.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from anglecam.data.typing import Floats

KGF_CM = 9.80665e-2
"""Kilogram-force centimetre, N·m: the paper's "kg cm"."""


@dataclass(frozen=True)
class TurningMechanism:
    """Crank and slotted plate; the paper prints none of these lengths, so the defaults are chosen here."""

    crank: float = 0.025
    """r, from the servo's axis A to the pin C, m: the paper's servo horn."""
    distance: float = 0.014
    """d, from the bearing O to the servo's axis A, m."""
    offset: float = 0.0
    """e, of the centre line of the slot from O, m; a positive one makes φ negative at neutral."""
    travel: float = math.radians(90.0)
    """The servo's largest angle to either side of neutral, rad."""


def turning_angle(mechanism: TurningMechanism, servo: ArrayLike) -> Floats:
    """Return the head angle for a servo angle.

    Parameters
    ----------
    mechanism : TurningMechanism
        Lengths, m.
    servo : array_like
        Servo angle from neutral, rad.

    Returns
    -------
    ndarray
        φ, rad, continuous in the servo angle from −π to π.

    Raises
    ------
    ValueError
        If the pin is nearer to the bearing than the slot at one of the angles.
    """
    crank = np.asarray(servo, dtype=float)
    x, y = _pin(mechanism, crank)
    return np.asarray(np.arctan2(y, x) - np.arctan2(mechanism.offset, slider(mechanism, crank)))


def slider(mechanism: TurningMechanism, servo: ArrayLike) -> Floats:
    """Return the position of the block in the slot, from the foot of O; its range is the least length of the slot.

    Parameters
    ----------
    mechanism : TurningMechanism
        Lengths, m.
    servo : array_like
        Servo angle from neutral, rad.

    Returns
    -------
    ndarray
        x, m.

    Raises
    ------
    ValueError
        If the pin is nearer to the bearing than the slot at one of the angles.
    """
    crank = np.asarray(servo, dtype=float)
    x, y = _pin(mechanism, crank)
    square = x**2 + y**2 - mechanism.offset**2
    if np.any(square < 0):
        raise ValueError(
            f"the pin cannot reach the slot with the servo at {math.degrees(crank[square < 0].flat[0]):.1f}°"
        )
    return np.asarray(np.sqrt(square))


def turning_servo_angle(mechanism: TurningMechanism, phi: ArrayLike) -> Floats:
    """Return the servo angle for a head angle, between the dead centres around neutral.

    Parameters
    ----------
    mechanism : TurningMechanism
        Lengths, m.
    phi : array_like
        Head angle, rad.

    Returns
    -------
    ndarray
        s, rad from neutral.

    Raises
    ------
    ValueError
        If an angle is beyond `turning_range`.
    """
    head = np.asarray(phi, dtype=float)
    low, high = turning_range(mechanism)
    beyond = ~((head >= low - 1e-9) & (head <= high + 1e-9))
    if np.any(beyond):
        raise ValueError(
            f"a turn of {math.degrees(head[beyond].flat[0]):.2f}° is beyond the neck's "
            f"{math.degrees(low):.2f}° to {math.degrees(high):.2f}°"
        )
    head = np.clip(head, low, high)
    sine = (mechanism.offset + mechanism.distance * np.sin(head)) / mechanism.crank
    return np.asarray(head + np.arcsin(np.clip(sine, -1.0, 1.0)))


def turning_slope(mechanism: TurningMechanism, servo: ArrayLike) -> Floats:
    """Return the slope of head over servo, dφ/ds.

    Parameters
    ----------
    mechanism : TurningMechanism
        Lengths, m.
    servo : array_like
        Servo angle from neutral, rad.

    Returns
    -------
    ndarray
        Without unit: 0 at a dead centre, where crank and slot are perpendicular.

    Raises
    ------
    ValueError
        If the pin is nearer to the bearing than the slot at one of the angles.
    """
    crank = np.asarray(servo, dtype=float)
    cosine = np.cos(crank - turning_angle(mechanism, crank))
    return np.asarray(mechanism.crank * cosine / slider(mechanism, crank))


def turning_range(mechanism: TurningMechanism) -> tuple[float, float]:
    """Return the lowest and highest head angle: at the end of the servo travel or at a dead centre, whichever is first.

    Parameters
    ----------
    mechanism : TurningMechanism
        Lengths, m.

    Returns
    -------
    tuple of float
        φ, rad.

    Raises
    ------
    ValueError
        If the pin cannot reach the slot at the end of the travel.
    """
    r, d, e = mechanism.crank, mechanism.distance, mechanism.offset
    low, high = -mechanism.travel, mechanism.travel
    # a dead centre has s − φ = ±π/2 in the closure above
    if abs(r - e) < d:
        high = min(high, math.asin((r - e) / d) + math.pi / 2)
    if abs(r + e) < d:
        low = max(low, -math.asin((r + e) / d) - math.pi / 2)
    lowest, highest = turning_angle(mechanism, [low, high])
    return float(lowest), float(highest)


def bearing_torque(load: float, friction: float, bore: float) -> float:
    """Return the friction torque of a rolling bearing by its bore, Eq. (4): F·f·d/2.

    Parameters
    ----------
    load : float
        F, axial or radial, N.
    friction : float
        f, coefficient of friction relative to the bore; 0.001 for the paper's thrust bearing.
    bore : float
        d, diameter of the shaft, m.

    Returns
    -------
    float
        M_r, N·m.
    """
    return load * friction * bore / 2


def bearing_torque_mean(load: float, friction: float, bore: float, outside: float) -> float:
    """Return the friction torque of a rolling bearing by its mean diameter, Eq. (4): F·f_m·D_m/2 with D_m = (d + D)/2.

    Parameters
    ----------
    load : float
        F, axial or radial, N.
    friction : float
        f_m, coefficient of friction relative to the mean diameter.
    bore, outside : float
        d and D, m.

    Returns
    -------
    float
        M_r, N·m.
    """
    return bearing_torque(load, friction, (bore + outside) / 2)


def turning_start_torque(running: float, start: float = 2.0, load: float = 3.0) -> float:
    """Return the starting torque of the bearing.

    Parameters
    ----------
    running : float
        Friction torque while turning, N·m.
    start : float
        Ratio of starting to running friction; "two-fold" in the paper.
    load : float
        Load factor. The paper prints none; its 0.00876 kg·cm from 0.00146 kg·cm needs 3.

    Returns
    -------
    float
        N·m.
    """
    return running * start * load


def _pin(mechanism: TurningMechanism, servo: Floats) -> tuple[Floats, Floats]:
    """Return C from O, with x along the line O→A, m."""
    return (
        np.asarray(mechanism.distance + mechanism.crank * np.cos(servo)),
        np.asarray(mechanism.crank * np.sin(servo)),
    )
