"""The head as an inverted pendulum on the nodding shaft, Fig. 6 (c): Eqs. (13)-(16).

    (M_h·ÿ − M_h·g)·L·sin θ + M_h·ẍ·L·cos θ + J_cg·θ̈ + T_d + F_s·L_s − T = 0                            Eq. (13)
    x = L·sin θ,   y = −L·cos θ                                                                          Eq. (14)
    ẍ = L·(θ̈·cos θ − θ̇²·sin θ),   ÿ = L·(θ̈·sin θ + θ̇²·cos θ)                                          Eq. (15)
    (M_h·L² + J_cg)·θ̈ + T_d + F_s·L_s − M_h·g·L·sin θ − T = 0                                            Eq. (16)

θ is the angle of the centre of mass from upright, θ0 + Δθ, and y points down.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from anglecam.data.typing import Floats
from anglecam.neck.parameters import HeadParameters


def centre_of_mass(head: HeadParameters, theta: ArrayLike) -> tuple[Floats, Floats]:
    """Return the position of the centre of mass, Eq. (14).

    Parameters
    ----------
    head : HeadParameters
        With the distance L of the centre of mass from the pivot.
    theta : array_like
        Angle from upright, rad.

    Returns
    -------
    x, y : ndarray
        Forwards and downwards from the pivot, m.
    """
    angle = np.asarray(theta, dtype=float)
    return head.centre_of_mass * np.sin(angle), -head.centre_of_mass * np.cos(angle)


def centre_of_mass_acceleration(
    head: HeadParameters, theta: ArrayLike, omega: ArrayLike, alpha: ArrayLike
) -> tuple[Floats, Floats]:
    """Return the acceleration of the centre of mass, Eq. (15).

    Parameters
    ----------
    head : HeadParameters
        With the distance L of the centre of mass from the pivot.
    theta, omega, alpha : array_like
        Angle from upright (rad), speed (rad/s) and acceleration (rad/s²).

    Returns
    -------
    x, y : ndarray
        ẍ forwards and ÿ downwards, m/s².
    """
    angle, speed, rate = (np.asarray(value, dtype=float) for value in (theta, omega, alpha))
    sine, cosine = np.sin(angle), np.cos(angle)
    along_x = head.centre_of_mass * (rate * cosine - speed**2 * sine)
    along_y = head.centre_of_mass * (rate * sine + speed**2 * cosine)
    return np.asarray(along_x), np.asarray(along_y)


def moments_about_pivot(
    head: HeadParameters, theta: ArrayLike, omega: ArrayLike, alpha: ArrayLike, resisting: ArrayLike, torque: ArrayLike
) -> Floats:
    """Return the sum of moments about the pivot, with inertia as a load (D'Alembert), Eq. (13).

    Parameters
    ----------
    head : HeadParameters
        Mass and inertia.
    theta, omega, alpha : array_like
        Angle from upright (rad), speed (rad/s) and acceleration (rad/s²).
    resisting : array_like
        T_d + F_s·L_s of damping and spring, N·m.
    torque : array_like
        T of the servo, N·m.

    Returns
    -------
    ndarray
        Residual, N·m: zero for a motion that obeys the equation.
    """
    x, y = centre_of_mass_acceleration(head, theta, omega, alpha)
    forward, down = centre_of_mass(head, theta)
    inertial = head.mass * (x * -down + (y - head.gravity) * forward)
    rotational = head.own_inertia * np.asarray(alpha, dtype=float)
    return np.asarray(inertial + rotational + np.asarray(resisting, dtype=float) - np.asarray(torque, dtype=float))


def head_acceleration(head: HeadParameters, theta: ArrayLike, resisting: ArrayLike, torque: ArrayLike) -> Floats:
    """Return the acceleration of the head, Eq. (16) solved for θ̈.

    Parameters
    ----------
    head : HeadParameters
        Mass and inertia.
    theta : array_like
        Angle from upright, rad.
    resisting : array_like
        T_d + F_s·L_s of damping and spring, N·m.
    torque : array_like
        T of the servo, N·m.

    Returns
    -------
    ndarray
        θ̈, rad/s².
    """
    weight = head.weight_moment * np.sin(np.asarray(theta, dtype=float))
    driving = np.asarray(torque, dtype=float) - np.asarray(resisting, dtype=float)
    return np.asarray((driving + weight) / head.inertia)
