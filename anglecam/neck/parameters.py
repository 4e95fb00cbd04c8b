"""The quantities of a nodding neck, from Table 5 and the text of the paper, in SI."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from anglecam.neck.fourbar import FourBar


@dataclass(frozen=True)
class ServoParameters:
    """An RC servo with potentiometer feedback, Fig. 5."""

    motor_constant: float = 3.3e-3
    """K_m, N·m/A or V·s/rad."""
    amplifier_gain: float = 37.0
    """G_a, V/V."""
    gear_ratio: float = 1.0 / 12.0
    """G_g, motor torque over gear torque, Eq. (9)."""
    output_impedance: float = 0.5
    """R_a, Ω."""
    sensor_gain: float = 1.4
    """h, V/rad."""
    rotor_inertia: float = 0.11475e-10
    """J_r, kg·m²."""
    command_gain: float = 1.0
    """C_i of Eq. (29), V/rad: input voltage per commanded angle. The paper prints no value."""

    @property
    def torque_gain(self) -> float:
        """c3 = K_m·G_a/(G_g·R_a), N·m/V."""
        return self.motor_constant * self.amplifier_gain / (self.gear_ratio * self.output_impedance)

    @property
    def back_emf_damping(self) -> float:
        """K_m²/(G_g²·R_a) of Eq. (11), N·m·s: c3·c4 with c4 = K_m/(G_a·G_g)."""
        return self.motor_constant**2 / (self.gear_ratio**2 * self.output_impedance)


@dataclass(frozen=True)
class HeadParameters:
    """The head as a body on the nodding shaft, Fig. 6 (c)."""

    mass: float = 2.31
    """M_h, kg. Table 4 and the text print 2.31, Table 5 prints 2.319."""
    centre_of_mass: float = 0.05
    """L, from the pivot, m."""
    own_inertia: float = 0.075e-3
    """J_cg about the centre of mass, kg·m²."""
    neutral: float = math.radians(45.0)
    """θ0, of the centre of mass from upright at neutral, rad."""
    gravity: float = 9.81
    """g, m/s²."""

    @property
    def inertia(self) -> float:
        """J = J_cg + M_h·L² about the pivot, kg·m², Eq. (27)."""
        return self.own_inertia + self.mass * self.centre_of_mass**2

    @property
    def weight_moment(self) -> float:
        """M_h·g·L, N·m."""
        return self.mass * self.gravity * self.centre_of_mass


@dataclass(frozen=True)
class SpringParameters:
    """The spring that holds the head, Fig. 6 (a) and (b)."""

    rate: float = 1877.8
    """K, N/m: 10.72 lb/in."""
    base: float = 0.048
    """L2, m: from the pivot to the fixed end of the spring."""
    arm: float = 0.059
    """L6, m: from the pivot to the end of the spring on the head."""


@dataclass(frozen=True)
class NeckParameters:
    """Every quantity in the paper's equations of motion; the defaults are the paper's prototype, Table 5."""

    servo: ServoParameters = field(default_factory=ServoParameters)
    head: HeadParameters = field(default_factory=HeadParameters)
    spring: SpringParameters = field(default_factory=SpringParameters)
    linkage: FourBar = field(default_factory=FourBar)
    damping: float = 0.15
    """C, N·m·s."""
    gamma: float = -0.36
    """γ of Eqs. (3) and (28), without unit."""


PAPER = NeckParameters()
"""The prototype of Table 5."""
