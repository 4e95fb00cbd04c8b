"""Static balance of spring and weight, and the torque that remains: Eqs. (23)-(24).

    F(θ) = F_s·L_s − M_h·g·L·sin θ = 0                                                                   Eq. (23)
    F(θ0) = K·(θ0 − θ_p)·L6·L2 − M_h·g·L·sin θ0 = 0                                                      Eq. (24)

θ_p is the angle at which the spring would be slack if Eq. (18a) held at every angle. F is a restoring torque where it
is positive; away from neutral the motor has to overcome it. Angles Δθ = θ − θ0 are from neutral.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from anglecam.data.typing import Floats
from anglecam.neck.linear import passive_stiffness
from anglecam.neck.parameters import HeadParameters, NeckParameters, SpringParameters
from anglecam.neck.spring import Preload, elongation, spring_torque

SEARCHED = math.radians(90.0)
"""Largest angle from neutral at which a balance is searched, rad."""
STEPS = 720
"""Number of steps into which the range is divided; two balances within one step are not resolved."""


@dataclass(frozen=True)
class StaticCurve:
    """Torques of spring and weight over the head angle, arrays of shape (n,)."""

    delta: Floats
    """Δθ, rad."""
    spring: Floats
    """F_s·L_s, N·m."""
    weight: Floats
    """M_h·g·L·sin θ, N·m."""
    small_angle: Floats
    """F by Eq. (25), (K·L2·L6 − M_h·g·L·cos θ0)·Δθ, N·m."""

    @property
    def residual(self) -> Floats:
        """F of Eq. (23), N·m."""
        return self.spring - self.weight


def weight_torque(head: HeadParameters, delta: ArrayLike) -> Floats:
    """Return the torque of the weight away from upright, M_h·g·L·sin(θ0 + Δθ), N·m, at an angle from neutral, rad."""
    return np.asarray(head.weight_moment * np.sin(head.neutral + np.asarray(delta, dtype=float)))


def pretension_angle(neck: NeckParameters) -> float:
    """Return the θ_p that balances the head at neutral, Eq. (24), rad from upright.

    Parameters
    ----------
    neck : NeckParameters
        Spring and head.

    Returns
    -------
    float
        θ_p = θ0 − M_h·g·L·sin θ0/(K·L2·L6).
    """
    spring = neck.spring
    carried = neck.head.weight_moment * math.sin(neck.head.neutral)
    return neck.head.neutral - carried / (spring.rate * spring.arm * spring.base)


def neutral_torque(neck: NeckParameters, theta_p: float) -> float:
    """Return F(θ0) of Eq. (24), N·m, for a pretension angle, rad from upright: zero if the head is balanced."""
    spring, head = neck.spring, neck.head
    return spring.rate * (head.neutral - theta_p) * spring.arm * spring.base - head.weight_moment * math.sin(
        head.neutral
    )


def pretension(neck: NeckParameters, theta_p: float, *, common: float | None = None) -> Preload:
    """Return the stretch of the springs for a pretension angle.

    Parameters
    ----------
    neck : NeckParameters
        Spring and head.
    theta_p : float
        Pretension angle of Eq. (24), rad from upright.
    common : float, optional
        For two opposing springs: stretch at neutral of the less stretched one, m. ``None`` for the paper's single
        spring.

    Returns
    -------
    Preload
        With the torque K·(θ0 − θ_p)·L6·L2 at neutral, as in Eq. (24).
    """
    stretch = neck.spring.base * (neck.head.neutral - theta_p)  # at the rate K·L6/L2 and the arm L2
    if common is None:
        return Preload(stretch)
    return Preload(common + max(2.0 * stretch, 0.0), common + max(-2.0 * stretch, 0.0))  # of half the rate each


def balanced(neck: NeckParameters, *, common: float | None = None, excess: float = 0.0) -> Preload:
    """Return the stretch of the springs that carries the head at neutral, Eqs. (23)-(24).

    Parameters
    ----------
    neck : NeckParameters
        Spring and head.
    common : float, optional
        As for `pretension`.
    excess : float
        Torque by which the springs exceed the weight, N·m.

    Returns
    -------
    Preload
        With F(θ0) = ``excess``.
    """
    spring = neck.spring
    more = excess / (spring.rate * spring.arm * spring.base)
    return pretension(neck, pretension_angle(neck) - more, common=common)


def slack_limit(spring: SpringParameters, low: float, high: float) -> float:
    """Return the least common stretch, m, with which neither of two springs goes slack between two angles, rad.

    Parameters
    ----------
    spring : SpringParameters
        Lengths.
    low, high : float
        Range of Δθ, rad.

    Returns
    -------
    float
        For ``common`` of `pretension`, without the stretch that the head's weight adds.
    """
    # the springs mirror each other, and a spring is shortest where base and arm lie in one line
    furthest = max(-low, high, 0.0)
    return -float(elongation(spring, -min(furthest, math.acos(spring.base / spring.arm))))


def static_torque(neck: NeckParameters, preload: Preload, delta: ArrayLike) -> Floats:
    """Return the torque that a motor has to overcome to hold the head, F of Eq. (23) at large angles.

    Parameters
    ----------
    neck : NeckParameters
        Spring and head.
    preload : Preload
        Stretch of the springs at neutral.
    delta : array_like
        Δθ, rad.

    Returns
    -------
    ndarray
        N·m; it acts towards neutral where it has the sign of Δθ.
    """
    return np.asarray(spring_torque(neck.spring, preload, delta) - weight_torque(neck.head, delta))


def static_curve(neck: NeckParameters, preload: Preload, delta: ArrayLike) -> StaticCurve:
    """Return the torques of spring and weight over the head angle.

    Parameters
    ----------
    neck : NeckParameters
        Spring and head.
    preload : Preload
        Stretch of the springs at neutral.
    delta : array_like
        Δθ of shape (n,), rad.

    Returns
    -------
    StaticCurve
        Torques, N·m.
    """
    angle = np.asarray(delta, dtype=float)
    return StaticCurve(
        delta=angle,
        spring=spring_torque(neck.spring, preload, angle),
        weight=weight_torque(neck.head, angle),
        small_angle=np.asarray(passive_stiffness(neck) * angle),
    )


def neutral_angle(neck: NeckParameters, preload: Preload) -> float:
    """Return where the head rests without a motor with a given pretension, F(θ) = 0 of Eq. (23).

    Parameters
    ----------
    neck : NeckParameters
        Spring and head.
    preload : Preload
        Stretch of the springs at Δθ = 0.

    Returns
    -------
    float
        The stable Δθ nearest to zero, rad; zero for a preload of `balanced`.

    Raises
    ------
    ValueError
        If there is no stable balance within 90°.
    """
    return stable_zero(lambda delta: static_torque(neck, preload, delta), -SEARCHED, SEARCHED)


def stable_zero(torque: Callable[[Floats], Floats], low: float, high: float) -> float:
    """Return the angle nearest to neutral at which a restoring torque vanishes and increases with the angle.

    Parameters
    ----------
    torque : callable
        From angles of shape (n,), rad, to the torque towards smaller angles, N·m; smooth.
    low, high : float
        Range to search, rad.

    Returns
    -------
    float
        rad, to rounding error.

    Raises
    ------
    ValueError
        If there is no such angle.
    """
    from scipy.optimize import brentq  # SciPy takes most of a second to load

    grid = np.linspace(low, high, STEPS + 1)
    values = torque(grid)
    starts = np.flatnonzero((values[:-1] < 0.0) & (values[1:] >= 0.0))
    if len(starts) == 0:
        raise ValueError(
            f"nothing balances stably between {math.degrees(low):.1f}° and {math.degrees(high):.1f}° from neutral: the "
            f"restoring torque is {values.min():.3g} to {values.max():.3g} N·m"
        )
    roots = [
        brentq(lambda at: float(torque(np.array([at]))[0]), grid[i], grid[i + 1], xtol=1e-15, rtol=1e-14)
        for i in starts
    ]
    return float(min(roots, key=abs))
