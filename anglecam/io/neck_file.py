"""A neck declared in a file: ``NECK.yaml``, every key optional, an unknown key an error, the defaults the paper's.

Keys end in their unit: SI, and degrees where they end in ``_deg``. The paper's design example is not quite its Table 5:
it weighs 2.319 kg instead of 2.31, rounds J to 0.0058 kg·m² and begins with the damping of the oil film where Table 5
has what was identified. Where ``head`` or ``damping_N_m_s`` is not declared, the design takes those.
"""

# ruff: noqa: N815 - keys are written with the units of SI

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from anglecam.errors import RigError
from anglecam.io.yaml_schema import Declared, Finite, NotNegative, Positive, read_declared
from anglecam.neck.command_table import TABLE_3, CommandScale
from anglecam.neck.damping import Film
from anglecam.neck.design import known
from anglecam.neck.fourbar import FourBar
from anglecam.neck.joint import Joint, Quantity
from anglecam.neck.large_angle import LargeAngleNeck
from anglecam.neck.parameters import PAPER, Head, NeckParameters, Servo, Spring
from anglecam.neck.turning import TurningMechanism
from anglecam.neck.variation import nod_slope

Slope = Annotated[float, Field(gt=-10, lt=10, allow_inf_nan=False)]
Angle = Annotated[float, Field(gt=-180, lt=180, allow_inf_nan=False)]

EXAMPLE_MASS, EXAMPLE_INERTIA = 2.319, 0.0058
"""Of the paper's design example: M_h, kg, in the weight, and J, kg·m²."""


@dataclass(frozen=True)
class Bearing:
    """The thrust bearing that the head turns on, Eq. (4)."""

    friction: float = 0.001
    """f, as the paper estimates it."""
    bore: float = 12.7e-3
    """d, m."""


@dataclass(frozen=True)
class Neck:
    """All that the calculations of a neck are of."""

    parameters: NeckParameters
    large_angle: LargeAngleNeck
    scale: CommandScale
    """From the 8-bit command to the servo."""
    turning: TurningMechanism
    bearing: Bearing
    film: Film
    example: NeckParameters
    """What the design procedure is of."""
    beforehand: Joint
    """What it takes as known; see `anglecam.neck.design.known`."""


class _Linkage(Declared):
    ground_m: Positive = PAPER.linkage.ground
    coupler_m: Positive = PAPER.linkage.coupler
    rocker_m: Positive = PAPER.linkage.rocker
    crank_m: Positive = PAPER.linkage.crank


class _Servo(Declared):
    motor_constant_N_m_per_A: Positive = PAPER.servo.motor_constant
    amplifier_gain: Positive = PAPER.servo.amplifier_gain
    gear_ratio: Positive = PAPER.servo.gear_ratio
    output_impedance_ohm: Positive = PAPER.servo.output_impedance
    sensor_gain_V_per_rad: NotNegative = PAPER.servo.sensor_gain
    rotor_inertia_kg_m2: NotNegative = PAPER.servo.rotor_inertia
    command_gain_V_per_rad: Positive = PAPER.servo.command_gain


class _Head(Declared):
    mass_kg: Positive = PAPER.head.mass
    centre_of_mass_m: Positive = PAPER.head.centre_of_mass
    own_inertia_kg_m2: NotNegative = PAPER.head.own_inertia
    neutral_deg: Angle = math.degrees(PAPER.head.neutral)
    gravity_m_per_s2: NotNegative = PAPER.head.gravity


class _Spring(Declared):
    rate_N_per_m: Positive = PAPER.spring.rate
    base_m: Positive = PAPER.spring.base
    arm_m: Positive = PAPER.spring.arm
    common_stretch_m: NotNegative | None = None
    """Of two springs against each other; null for the paper's single one that also pushes."""
    pretension_error_N_m: Finite = 0.0
    """Torque at neutral by which they carry more than the head."""


class _Turning(Declared):
    crank_m: Positive = TurningMechanism.crank
    distance_m: Positive = TurningMechanism.distance
    offset_m: Finite = TurningMechanism.offset
    travel_deg: Annotated[float, Field(gt=0, le=180)] = math.degrees(TurningMechanism.travel)


class _Bearing(Declared):
    friction: NotNegative = Bearing.friction
    bore_m: Positive = Bearing.bore


class _Film(Declared):
    viscosity_N_s_per_m2: Positive = Film.viscosity
    diameter_m: Positive = Film.diameter
    width_m: Positive = Film.width
    thickness_m: Positive = Film.thickness


class _Command(Declared):
    up_deg_per_count: Positive = math.degrees(TABLE_3.up)
    down_deg_per_count: Positive = math.degrees(TABLE_3.down)


class _Sigma(Declared):
    """Standard uncertainties of what is known, in the units of the keys; the rest counts as exact."""

    sensor_gain_V_per_rad: NotNegative = 0.0
    motor_constant_N_m_per_A: NotNegative = 0.0
    amplifier_gain: NotNegative = 0.0
    gear_ratio: NotNegative = 0.0
    output_impedance_ohm: NotNegative = 0.0
    rotor_inertia_kg_m2: NotNegative = 0.0
    mass_kg: NotNegative = 0.0
    centre_of_mass_m: NotNegative = 0.0
    own_inertia_kg_m2: NotNegative = 0.0
    neutral_deg: NotNegative = 0.0
    rate_N_per_m: NotNegative = 0.0
    base_m: NotNegative = 0.0
    arm_m: NotNegative = 0.0
    damping_N_m_s: NotNegative = 0.0
    gamma: NotNegative = 0.0


_SYMBOLS = {
    "sensor_gain_V_per_rad": "h",
    "motor_constant_N_m_per_A": "K_m",
    "amplifier_gain": "G_a",
    "gear_ratio": "G_g",
    "output_impedance_ohm": "R_a",
    "rotor_inertia_kg_m2": "J_r",
    "mass_kg": "M_h",
    "centre_of_mass_m": "L",
    "own_inertia_kg_m2": "J_cg",
    "neutral_deg": "theta_0",
    "rate_N_per_m": "K",
    "base_m": "L_2",
    "arm_m": "L_6",
    "damping_N_m_s": "C",
    "gamma": "gamma",
}
"""Keys of `_Sigma` by what `anglecam.neck.design.known` calls them."""


class NeckFile(Declared):
    """What a neck file may hold."""

    linkage: _Linkage = _Linkage()
    servo: _Servo = _Servo()
    head: _Head | None = None
    spring: _Spring = _Spring()
    damping_N_m_s: NotNegative | None = None
    gamma: Slope | None = None
    """Slope dθ_f/dθ_s; of declared links the line fitted over the nod, else the paper's −0.36."""
    linkage_slope: Literal["constant", "exact"] = "constant"
    """Whether Eq. (31) takes γ as constant or follows the four-bar."""
    turning: _Turning = _Turning()
    bearing: _Bearing = _Bearing()
    film: _Film = _Film()
    command: _Command = _Command()
    sigma: _Sigma = _Sigma()


def read_neck(path: Path | None) -> Neck:
    """Read a neck file, or take the paper's neck.

    Parameters
    ----------
    path : Path or None
        A YAML file; see `NeckFile` and ``configs/necks/paper.yaml``.

    Returns
    -------
    Neck
        In SI.

    Raises
    ------
    RigError
        Naming the file, the key and the cause; also where the declared links close nowhere.
    """
    if path is None:
        return neck_of(NeckFile())
    told = read_declared(path, NeckFile)
    try:
        return neck_of(told)
    except ValueError as fault:
        raise RigError(f"{path}: {fault}") from fault


def neck_of(told: NeckFile) -> Neck:
    """Put together what a file declares; see `read_neck`."""
    links, servo, spring, turning = told.linkage, told.servo, told.spring, told.turning
    linkage = FourBar(links.ground_m, links.coupler_m, links.rocker_m, links.crank_m)
    gamma = told.gamma
    if gamma is None:
        gamma = PAPER.gamma if linkage == PAPER.linkage else nod_slope(linkage)
    parameters = NeckParameters(
        servo=Servo(
            motor_constant=servo.motor_constant_N_m_per_A,
            amplifier_gain=servo.amplifier_gain,
            gear_ratio=servo.gear_ratio,
            output_impedance=servo.output_impedance_ohm,
            sensor_gain=servo.sensor_gain_V_per_rad,
            rotor_inertia=servo.rotor_inertia_kg_m2,
            command_gain=servo.command_gain_V_per_rad,
        ),
        head=_head(told.head or _Head()),
        spring=Spring(spring.rate_N_per_m, spring.base_m, spring.arm_m),
        linkage=linkage,
        damping=PAPER.damping if told.damping_N_m_s is None else told.damping_N_m_s,
        gamma=gamma,
    )
    film = Film(told.film.viscosity_N_s_per_m2, told.film.diameter_m, told.film.width_m, told.film.thickness_m)
    example = _example(told, parameters, film)
    return Neck(
        parameters=parameters,
        large_angle=LargeAngleNeck(
            parameters, told.linkage_slope, spring.common_stretch_m, spring.pretension_error_N_m
        ),
        scale=CommandScale(
            up=math.radians(told.command.up_deg_per_count), down=math.radians(told.command.down_deg_per_count)
        ),
        turning=TurningMechanism(
            turning.crank_m, turning.distance_m, turning.offset_m, math.radians(turning.travel_deg)
        ),
        bearing=Bearing(told.bearing.friction, told.bearing.bore_m),
        film=film,
        example=example,
        beforehand=_beforehand(told, example),
    )


def _head(told: _Head) -> Head:
    return Head(
        told.mass_kg,
        told.centre_of_mass_m,
        told.own_inertia_kg_m2,
        math.radians(told.neutral_deg),
        told.gravity_m_per_s2,
    )


def _example(told: NeckFile, neck: NeckParameters, film: Film) -> NeckParameters:
    """Put the paper's design example in place of what is not declared."""
    if told.damping_N_m_s is None:
        neck = replace(neck, damping=film.damping)
    if told.head is None:
        neck = replace(neck, head=replace(neck.head, mass=EXAMPLE_MASS))
    return neck


def _beforehand(told: NeckFile, neck: NeckParameters) -> Joint:
    errors = {_SYMBOLS[key]: value for key, value in told.sigma.model_dump().items()}
    errors["theta_0"] = math.radians(errors["theta_0"])
    taken = known(neck, errors)
    return taken.replaced(inertia=Quantity(EXAMPLE_INERTIA)) if told.head is None else taken
