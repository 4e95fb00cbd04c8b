"""The neck at any angle, Eq. (31), and its linearisation at an equilibrium, Eq. (33).

    G = (J + J_r·γ)·θ̈ + (C + K_m²·γ/(G_g²·R_a))·θ̇ + F_s·L_s − M_h·g·L·sin(θ0 + Δθ) + c3·h·γ·Δθ − c3·U_in = 0   (31)
    ψ·Δθ̈ + ϖ·Δθ̇ + η·Δθ + φ·ΔU_in = 0                                                                         (33)

Eq. (31) writes θ for the head's angle both from upright and from neutral; the servo angle is from neutral, as in
Eqs. (12) and (28). F_s·L_s is that of `anglecam.neck.spring`, which explains where Eqs. (18b) and (33) disagree in sign
and rate. The feedback term of η is printed with a minus, against Eqs. (28) and (31): here it has the plus of Eq. (31).

γ is either the constant of Eq. (3) or follows the four-bar. In the second case it is the exact slope
γ(Δθ) = dθ_f/dθ_s at every angle, and θ_a = γ·Δθ of Eq. (12) becomes θ_a = Γ(Δθ) = ∫γ dΔθ, so that θ̇_a = γ·θ̇ and
θ̈_a = γ·θ̈ + γ′·θ̇². `anglecam.neck.linear` explains which way round γ is defined. In both cases the equation reduces to
Eq. (28) at small angles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from anglecam.data.typing import Floats
from anglecam.neck.fourbar import NEUTRAL_SERVO, FourBar, head_angle, reach, servo_angle
from anglecam.neck.parameters import PAPER, NeckParameters
from anglecam.neck.spring import Preload, spring_tangent
from anglecam.neck.statics import balanced, stable_zero, static_torque
from anglecam.neck.transmission import bend, slope

if TYPE_CHECKING:
    from scipy.interpolate import CubicHermiteSpline

WIDEST = math.radians(120.0)
"""Largest angle from neutral at which constant γ is used, rad; the equations themselves have no end stop."""
KNOTS = 1025
"""Number of knots of the spline for Γ."""


@dataclass(frozen=True)
class ConstantRatio:
    """θ_a = γ·Δθ, Eq. (3)."""

    gamma: float
    """γ, without unit."""
    reach: tuple[float, float] = (-WIDEST, WIDEST)
    """Lowest and highest Δθ, rad."""

    def travel(self, delta: ArrayLike) -> Floats:
        """Return θ_a, rad, at angles Δθ, rad."""
        return np.asarray(self.gamma * np.asarray(delta, dtype=float))

    def slope(self, delta: ArrayLike) -> Floats:
        """Return γ at angles Δθ, rad."""
        return np.full(np.shape(delta), self.gamma)

    def bend(self, delta: ArrayLike) -> Floats:
        """Return dγ/dΔθ, 1/rad, which is zero."""
        return np.zeros(np.shape(delta))


@dataclass(frozen=True)
class LinkageRatio:
    """θ_a = Γ(Δθ) = ∫γ dΔθ from neutral, with the exact slope γ of the four-bar; NaN where the links do not close."""

    linkage: FourBar

    @cached_property
    def neutral_rocker(self) -> float:
        """θ_f at neutral, rad."""
        return float(head_angle(self.linkage, NEUTRAL_SERVO))

    @cached_property
    def reach(self) -> tuple[float, float]:
        """Lowest and highest Δθ = θ_f0 − θ_f at which the links close, rad."""
        low, high = reach(self.linkage)
        return self.neutral_rocker - high, self.neutral_rocker - low

    def travel(self, delta: ArrayLike) -> Floats:
        """Return Γ, rad, at angles Δθ, rad, to 1e-12 rad."""
        low, high = self.reach
        with np.errstate(invalid="ignore"):
            xi = np.arccos((low + high - 2.0 * np.asarray(delta, dtype=float)) / (high - low))
        return np.asarray(self._travel(xi))

    def slope(self, delta: ArrayLike) -> Floats:
        """Return γ at angles Δθ, rad."""
        return slope(self.linkage, self._crank(delta))

    def bend(self, delta: ArrayLike) -> Floats:
        """Return dγ/dΔθ, 1/rad, at angles Δθ, rad; unbounded at the ends of the reach."""
        crank = self._crank(delta)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(-bend(self.linkage, crank) / slope(self.linkage, crank))  # dΔθ = −dθ_f = −γ·dθ_s

    def _crank(self, delta: ArrayLike) -> Floats:
        angle = np.asarray(delta, dtype=float)
        low, high = self.reach
        inside = np.where((angle >= low) & (angle <= high), angle, np.nan)
        return servo_angle(self.linkage, self.neutral_rocker - inside)

    @cached_property
    def _travel(self) -> CubicHermiteSpline:
        """Γ as a spline over ξ, with Δθ = middle − half·cos ξ.

        Over ξ it is smooth, whereas γ over Δθ ends like a square root.
        """
        from scipy.interpolate import CubicHermiteSpline  # SciPy takes most of a second to load

        low, high = self.reach
        middle, half = (low + high) / 2.0, (high - low) / 2.0

        def rate(xi: Floats) -> Floats:
            return np.asarray(self.slope(middle - half * np.cos(xi)) * half * np.sin(xi))

        xi = np.linspace(0.0, math.pi, KNOTS)
        start = math.acos(middle / half)
        nodes, weights = np.polynomial.legendre.leggauss(64)
        span = (xi - start)[:, None] / 2.0
        integral = (rate(start + span * (1.0 + nodes)) * weights).sum(axis=-1) * span[:, 0]
        return CubicHermiteSpline(xi, integral, rate(xi), extrapolate=False)


@lru_cache(maxsize=16)
def _linkage_ratio(linkage: FourBar) -> LinkageRatio:
    """Return the ratio of a linkage, with its spline computed once."""
    return LinkageRatio(linkage)


@dataclass(frozen=True)
class LargeAngleNeck:
    """The neck of Eq. (31)."""

    parameters: NeckParameters = PAPER
    """Servo, head, spring, linkage, damping; ``gamma`` is used where γ is constant."""
    gamma: Literal["constant", "exact"] = "constant"
    """Whether γ is the constant of Eq. (3) or the slope of the four-bar at every angle."""
    common_stretch: float | None = None
    """Stretch at neutral of the less stretched of two opposing springs, m; ``None`` for one that can also push."""
    pretension_error: float = 0.0
    """Torque at neutral by which the springs exceed the head's weight, N·m."""

    @cached_property
    def ratio(self) -> ConstantRatio | LinkageRatio:
        """Relation of head angle to servo angle."""
        if self.gamma == "constant":
            return ConstantRatio(self.parameters.gamma)
        return _linkage_ratio(self.parameters.linkage)

    @cached_property
    def preload(self) -> Preload:
        """Stretch of the springs at neutral that carries the head plus `pretension_error`, Eqs. (23)-(24)."""
        return balanced(self.parameters, common=self.common_stretch, excess=self.pretension_error)


@dataclass(frozen=True)
class Linearised:
    """Coefficients of Eq. (33) at one equilibrium."""

    psi: float
    """ψ of the acceleration, kg·m²."""
    varpi: float
    """ϖ of the speed, N·m·s."""
    eta: float
    """η of the angle, N·m."""
    phi: float
    """φ of the voltage, N·m/V; negative."""

    @property
    def a(self) -> float:
        """1/s, Eq. (30)."""
        return self.varpi / self.psi

    @property
    def b(self) -> float:
        """1/s², Eq. (30)."""
        return self.eta / self.psi

    @property
    def c(self) -> float:
        """rad/(s²·V), Eq. (30)."""
        return -self.phi / self.psi


def restoring_torque(neck: LargeAngleNeck, delta: ArrayLike) -> Floats:
    """Return the restoring torque at rest without a command: F_s·L_s − M_h·g·L·sin(θ0 + Δθ) + c3·h·θ_a, N·m.

    Parameters
    ----------
    neck : LargeAngleNeck
        Springs, head, servo and linkage.
    delta : array_like
        Δθ, rad.

    Returns
    -------
    ndarray
        N·m; it acts towards neutral where it has the sign of Δθ.
    """
    servo = neck.parameters.servo
    held = servo.torque_gain * servo.sensor_gain * neck.ratio.travel(delta)
    return np.asarray(static_torque(neck.parameters, neck.preload, delta) + held)


def restoring_tangent(neck: LargeAngleNeck, delta: ArrayLike) -> Floats:
    """Return the derivative of `restoring_torque` by Δθ: η of Eq. (33), N·m."""
    servo, head = neck.parameters.servo, neck.parameters.head
    angle = np.asarray(delta, dtype=float)
    spring = spring_tangent(neck.parameters.spring, neck.preload, angle)
    weight = head.weight_moment * np.cos(head.neutral + angle)
    return np.asarray(spring - weight + servo.torque_gain * servo.sensor_gain * neck.ratio.slope(angle))


def torque_balance(
    neck: LargeAngleNeck, alpha: ArrayLike, omega: ArrayLike, delta: ArrayLike, voltage: ArrayLike
) -> Floats:
    """Return G, the left side of Eq. (31), Eq. (32a).

    Parameters
    ----------
    neck : LargeAngleNeck
        Springs, head, servo and linkage.
    alpha, omega, delta : array_like
        θ̈ (rad/s²), θ̇ (rad/s) and Δθ (rad) of the head.
    voltage : array_like
        U_in, V.

    Returns
    -------
    ndarray
        N·m; zero along a motion that obeys the equation.
    """
    servo, speed = neck.parameters.servo, np.asarray(omega, dtype=float)
    gamma, curve = neck.ratio.slope(delta), neck.ratio.bend(delta)
    inertial = (neck.parameters.head.inertia + servo.rotor_inertia * gamma) * np.asarray(alpha, dtype=float)
    moving = (neck.parameters.damping + servo.back_emf_damping * gamma + servo.rotor_inertia * curve * speed) * speed
    driven = servo.torque_gain * np.asarray(voltage, dtype=float)
    return np.asarray(inertial + moving + restoring_torque(neck, delta) - driven)


def acceleration(neck: LargeAngleNeck, delta: ArrayLike, omega: ArrayLike, voltage: ArrayLike) -> Floats:
    """Return θ̈ from Eq. (31).

    Parameters
    ----------
    neck : LargeAngleNeck
        Springs, head, servo and linkage.
    delta, omega : array_like
        Δθ (rad) and θ̇ (rad/s) of the head.
    voltage : array_like
        U_in, V.

    Returns
    -------
    ndarray
        θ̈, rad/s²; NaN beyond the reach of an exact linkage.
    """
    inertia = neck.parameters.head.inertia + neck.parameters.servo.rotor_inertia * neck.ratio.slope(delta)
    return np.asarray(-torque_balance(neck, 0.0, omega, delta, voltage) / inertia)


def equilibrium(neck: LargeAngleNeck, voltage: float) -> float:
    """Return the angle at which a voltage holds the head, G = 0 of Eq. (31) at rest.

    Parameters
    ----------
    neck : LargeAngleNeck
        Springs, head, servo and linkage.
    voltage : float
        U_in, V.

    Returns
    -------
    float
        The stable Δθ nearest to neutral, rad.

    Raises
    ------
    ValueError
        If there is no such angle within the reach.
    """
    driven = neck.parameters.servo.torque_gain * voltage
    return stable_zero(lambda delta: restoring_torque(neck, delta) - driven, *neck.ratio.reach)


def holding_voltage(neck: LargeAngleNeck, delta: ArrayLike) -> Floats:
    """Return the voltage U_in, V, that holds the head at an angle Δθ, rad: G = 0 of Eq. (31) at rest."""
    return np.asarray(restoring_torque(neck, delta) / neck.parameters.servo.torque_gain)


def linearise(neck: LargeAngleNeck, delta: float = 0.0) -> Linearised:
    """Linearise the neck at an equilibrium, Eq. (33).

    Parameters
    ----------
    neck : LargeAngleNeck
        Springs, head, servo and linkage.
    delta : float
        Δθ at which a constant voltage holds the head (`equilibrium`, `holding_voltage`), rad.

    Returns
    -------
    Linearised
        At neutral and with constant γ, the coefficients of Eq. (28).
    """
    servo, gamma = neck.parameters.servo, float(neck.ratio.slope(delta))
    return Linearised(
        psi=neck.parameters.head.inertia + servo.rotor_inertia * gamma,
        varpi=neck.parameters.damping + servo.back_emf_damping * gamma,
        eta=float(restoring_tangent(neck, delta)),
        phi=-servo.torque_gain,
    )
