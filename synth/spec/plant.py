"""The sections of a spec that describe the plant and the servo controller.

A plant is the base model of Eq. (30), or the paper's neck with its servo, linkage, springs and head.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from synth.section import Finite, NotNegative, Positive, Section


class LinearPlant(Section):
    """The base model θ̈ = c·u − a·θ̇ − b·θ, Eq. (30); u is the commanded head angle."""

    kind: Literal["linear"] = "linear"
    a: NotNegative = 26.0
    """1/s."""
    b: NotNegative = 524.0
    """1/s²."""
    c: Positive = 508.0
    """1/s²."""


class NeckPlant(Section):
    """Servo, linkage and head of Eqs. (5)-(18) and (31); the numbers are those of Table 5."""

    kind: Literal["neck"]
    motor_constant: Positive = 3.3e-3
    """K_m, N·m/A."""
    amplifier_gain: Positive = 37.0
    """G_a."""
    gear_ratio: Positive = 1 / 12
    """G_g."""
    output_impedance: Positive = 0.5
    """R_a, Ω."""
    sensor_gain: NotNegative = 1.4
    """h, V/rad."""
    rotor_inertia: NotNegative = 0.11475e-10
    """J_r, kg·m²."""
    mass: Positive = 2.31
    """M_h, kg."""
    centre_of_mass: Positive = 0.05
    """L, distance from the pivot, m."""
    own_inertia: NotNegative = 0.075e-3
    """J_cg, kg·m²."""
    neutral_deg: Annotated[float, Field(gt=-90, lt=90, allow_inf_nan=False)] = 45.0
    """θ0, angle of the centre of mass from upright at neutral."""
    damping: NotNegative = 0.15
    """C, N·m·s."""
    spring_rate: Positive = 1877.8
    """K, N/m."""
    spring_base: Positive = 0.048
    """L2, m."""
    spring_arm: Positive = 0.059
    """L6, m."""
    gravity: NotNegative = 9.81
    """g, m/s²."""

    @model_validator(mode="after")
    def _spring_at_a_right_angle(self) -> NeckPlant:
        if self.spring_arm <= self.spring_base:
            raise ValueError("spring_arm: must be longer than spring_base, it is a right triangle's hypotenuse")
        return self


def _kind(plant: Any) -> str:
    return plant.get("kind", "linear") if isinstance(plant, dict) else getattr(plant, "kind", "linear")


Plant = Annotated[
    Annotated[LinearPlant, Tag("linear")] | Annotated[NeckPlant, Tag("neck")],
    Discriminator(_kind),
]


class Controller(Section):
    """The servo controller of Table 2, which quantises the command and sends it in pulses; absent by default."""

    pulse_hz: Positive | None = None
    """Position pulses per second, 50 in the paper; a command waits for the next pulse."""
    bits: Annotated[int, Field(ge=4, le=16)] | None = None
    """Resolution of the command, 8 in the paper: 2^bits levels over 180° of the servo's arm."""
    phase_s: Finite = 0.0
    """Time at which a pulse begins, on the clip's clock."""
