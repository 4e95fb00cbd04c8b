"""The neck at small angles: Eqs. (25)-(28) and their short form (30).

    (J + γ·J_r)·Δθ̈ + (C + K_m²·γ/(G_g²·R_a))·Δθ̇ + (c3·h·γ + K·L2·L6 − M_h·g·L·cos θ0)·Δθ = c3·U_in      Eq. (28)
    Δθ̈ + a·Δθ̇ + b·Δθ = c·U_in                                                                           Eq. (30)

γ is the slope dθ_f/dθ_s of Fig. 4. Eq. (3) defines it the other way round, which would put 1/γ into Eqs. (12), (28),
(34) and (35). But the values that the paper derives, h = 1.39, C = 0.15 and h < 4.26, follow with γ = −0.36 in its
place.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from anglecam.neck.parameters import NeckParameters


@dataclass(frozen=True)
class LinearNeck:
    """Coefficients of Eq. (28)."""

    inertia: float
    """J + γ·J_r, kg·m²."""
    damping: float
    """C + K_m²·γ/(G_g²·R_a), N·m·s."""
    stiffness: float
    """c3·h·γ + K·L2·L6 − M_h·g·L·cos θ0, N·m; positive if the neck is stable, Eq. (35)."""
    gain: float
    """c3, N·m/V."""

    @property
    def a(self) -> float:
        """Damping over inertia, 1/s, Eq. (30)."""
        return self.damping / self.inertia

    @property
    def b(self) -> float:
        """Stiffness over inertia, 1/s², Eq. (30)."""
        return self.stiffness / self.inertia

    @property
    def c(self) -> float:
        """Gain over inertia, rad/(s²·V), Eq. (30)."""
        return self.gain / self.inertia


def linear_neck(neck: NeckParameters) -> LinearNeck:
    """Return the linear neck at neutral, Eq. (28).

    Parameters
    ----------
    neck : NeckParameters
        Its quantities.

    Returns
    -------
    LinearNeck
        Stable or not.
    """
    servo, head, gamma = neck.servo, neck.head, neck.gamma
    return LinearNeck(
        inertia=head.inertia + gamma * servo.rotor_inertia,
        damping=neck.damping + gamma * servo.back_emf_damping,
        stiffness=gamma * servo.torque_gain * servo.sensor_gain + passive_stiffness(neck),
        gain=servo.torque_gain,
    )


def passive_stiffness(neck: NeckParameters) -> float:
    """Return the stiffness of spring and weight without the servo, Eq. (25): K·L2·L6 − M_h·g·L·cos θ0, N·m."""
    spring, head = neck.spring, neck.head
    return spring.rate * spring.base * spring.arm - head.weight_moment * math.cos(head.neutral)
