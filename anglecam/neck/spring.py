"""The spring that holds the head upright, Fig. 6 (a) and (b): Eqs. (17), (18a) and (18b).

    L_s = L2·L6·sin θ′ / ℓ(θ′),   ℓ(θ′)² = L2² + L6² − 2·L2·L6·cos θ′                                    Eq. (17)
    F_s = K·L6·Δθ                                      small angles                                      Eq. (18a)
    F_s = K·Δx,   Δx = ℓ(θ′) − h1                      large angles                                      Eq. (18b)

θ′ is the angle between L2 and L6 at the pivot, and L_s = dℓ/dθ′. Neutral is the right triangle of Fig. 6, sin θ_f =
h1/L6 and cos θ_f = L2/L6, where the length is h1 and the arm is L_s = L2, as in the paper.

Where the paper disagrees with itself:

- Eq. (18a) takes L6·Δθ as the change in length, so that its torque F_s·L2 has the tangent K·L2·L6, on which Eqs.
  (24)-(28) and the 5.31 of Table 5 rest. The lengths of Eq. (18b) change by L2·Δθ, with the tangent K·L2². The two
  agree at neutral if K in Eq. (18b) is the paper's K times L6/L2, `large_angle_rate`, which is used at large angles
  here.
- Eq. (18b) is printed as h1 − ℓ, a shortening, and Eq. (33) uses it with θ′ = θ_f + Δθ. Together they would push the
  head away from neutral; the elongation ℓ − h1 with θ′ = θ_f + Δθ pulls it back, as Eq. (25) requires.
- Eq. (18b) is zero at neutral, where the spring carries the head by Eqs. (23)-(24): the `Preload` is added to it.
- The text has two springs; the equations have one that can also push. `Preload` describes either. The two springs have
  half the rate each, oppose each other as mirror images at neutral, and need not push. At neutral dL_s/dθ′ = 0, so
  their common stretch does not change the tangent there; away from neutral it does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from anglecam.data.typing import Floats
from anglecam.neck.parameters import SpringParameters


@dataclass(frozen=True)
class Preload:
    """Stretch of the springs at neutral."""

    behind: float
    """Stretch of the spring that pulls the head back from upward nods, towards −Δθ, m."""
    before: float | None = None
    """Stretch of the opposing spring, m; ``None`` for the paper's single spring, which then has the whole rate and
    pushes where its stretch is negative."""

    @property
    def share(self) -> float:
        """Share of the whole rate in the spring behind."""
        return 1.0 if self.before is None else 0.5


def neutral_spring_angle(spring: SpringParameters) -> float:
    """Return θ_f of the right triangle of Fig. 6, cos θ_f = L2/L6, rad.

    Raises
    ------
    ValueError
        If L6, the hypotenuse, is not longer than L2.
    """
    if not 0.0 < spring.base < spring.arm:
        raise ValueError(f"spring: arm L6 = {spring.arm} m must be longer than base L2 = {spring.base} m")
    return math.acos(spring.base / spring.arm)


def large_angle_rate(spring: SpringParameters) -> float:
    """Return the rate with which Eq. (18b) has the tangent K·L2·L6 at neutral: K·L6/L2, N/m."""
    return spring.rate * spring.arm / spring.base


def length(spring: SpringParameters, theta_prime: ArrayLike) -> Floats:
    """Return the length ℓ, m, at an angle between L2 and L6, rad: the root in Eqs. (17) and (18b)."""
    base, arm = spring.base, spring.arm
    return np.asarray(np.sqrt(base**2 + arm**2 - 2.0 * base * arm * np.cos(np.asarray(theta_prime, dtype=float))))


def moment_arm(spring: SpringParameters, theta_prime: ArrayLike) -> Floats:
    """Return the arm L_s, m, at an angle between L2 and L6, rad, Eq. (17)."""
    angle = np.asarray(theta_prime, dtype=float)
    return np.asarray(spring.base * spring.arm * np.sin(angle) / length(spring, angle))


def moment_arm_slope(spring: SpringParameters, theta_prime: ArrayLike) -> Floats:
    """Return ∂L_s/∂θ of Eq. (33), m/rad, at an angle between L2 and L6, rad; as printed."""
    angle = np.asarray(theta_prime, dtype=float)
    c1, c2 = spring.base**2 + spring.arm**2, 2.0 * spring.arm * spring.base
    squared = c1 - c2 * np.cos(angle)
    return np.asarray((c2 * np.cos(angle) * squared - 0.5 * (c2 * np.sin(angle)) ** 2) / (2.0 * squared**1.5))


def elongation(spring: SpringParameters, delta: ArrayLike) -> Floats:
    """Return the elongation from neutral, m, at an angle of the head from neutral, rad: −Δx of Eq. (18b)."""
    neutral = neutral_spring_angle(spring)
    return np.asarray(length(spring, neutral + np.asarray(delta, dtype=float)) - length(spring, neutral))


def small_angle_torque(spring: SpringParameters, delta: ArrayLike) -> Floats:
    """Return the torque towards neutral, N·m, at an angle Δθ, rad: Eq. (18a) with the arm L2."""
    return np.asarray(spring.rate * spring.arm * np.asarray(delta, dtype=float) * spring.base)


def spring_torque(spring: SpringParameters, preload: Preload, delta: ArrayLike) -> Floats:
    """Return the torque of the springs at any angle, F_s·L_s of Eqs. (16)-(18b).

    Parameters
    ----------
    spring : SpringParameters
        Rate K of Eq. (18a) and lengths.
    preload : Preload
        Stretch at neutral.
    delta : array_like
        Δθ of the head from neutral, rad.

    Returns
    -------
    ndarray
        Torque, N·m; a positive one acts against Δθ.
    """
    angle, neutral, rate = np.asarray(delta, dtype=float), neutral_spring_angle(spring), large_angle_rate(spring)
    torque = (preload.behind + elongation(spring, angle)) * moment_arm(spring, neutral + angle)
    if preload.before is not None:
        torque = torque - (preload.before + elongation(spring, -angle)) * moment_arm(spring, neutral - angle)
    return np.asarray(preload.share * rate * torque)


def spring_tangent(spring: SpringParameters, preload: Preload, delta: ArrayLike) -> Floats:
    """Return the derivative of `spring_torque`: K·(∂Δx/∂θ·L_s + ∂L_s/∂θ·Δx) of Eq. (33), with ∂Δx/∂θ = L_s.

    Parameters
    ----------
    spring : SpringParameters
        Rate K of Eq. (18a) and lengths.
    preload : Preload
        Stretch at neutral.
    delta : array_like
        Δθ of the head from neutral, rad.

    Returns
    -------
    ndarray
        Stiffness, N·m/rad: K·L2·L6 at neutral for any preload.
    """
    angle, neutral = np.asarray(delta, dtype=float), neutral_spring_angle(spring)

    def one_spring(stretch: float, change: Floats) -> Floats:
        at = neutral + change
        stretched = stretch + elongation(spring, change)
        return np.asarray(moment_arm(spring, at) ** 2 + moment_arm_slope(spring, at) * stretched)

    tangent = one_spring(preload.behind, angle)
    if preload.before is not None:
        tangent = tangent + one_spring(preload.before, -angle)
    return np.asarray(preload.share * large_angle_rate(spring) * tangent)
