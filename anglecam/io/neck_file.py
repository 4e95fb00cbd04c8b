"""Read a neck from a file, ``NECK.yaml``: every key is optional, an unknown key is an error, defaults are the paper's.

Keys end in their unit: SI, and degrees where they end in ``_deg``. The paper's design example differs from its Table 5:
the mass is 2.319 kg instead of 2.31 kg, J is rounded to 0.0058 kg·m², and the damping is that of the oil film where
Table 5 has the identified value. Where ``head`` or ``damping_N_m_s`` is not declared, the design procedure uses the
values of that example.
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
from anglecam.neck.correlated import CorrelatedQuantities, UncertainValue
from anglecam.neck.damping import OilFilm
from anglecam.neck.design import known
from anglecam.neck.fourbar import FourBar
from anglecam.neck.large_angle import LargeAngleNeck
from anglecam.neck.parameters import PAPER, HeadParameters, NeckParameters, ServoParameters, SpringParameters
from anglecam.neck.turning import TurningMechanism
from anglecam.neck.variation import nod_slope

Slope = Annotated[float, Field(gt=-10, lt=10, allow_inf_nan=False)]
Angle = Annotated[float, Field(gt=-180, lt=180, allow_inf_nan=False)]

EXAMPLE_MASS, EXAMPLE_INERTIA = 2.319, 0.0058
"""The paper's design example: M_h, kg, in the weight, and J, kg·m²."""


@dataclass(frozen=True)
class ThrustBearing:
    """The thrust bearing that carries the turning head, Eq. (4)."""

    friction: float = 0.001
    """f, the paper's estimate."""
    bore: float = 12.7e-3
    """d, m."""


@dataclass(frozen=True)
class DeclaredNeck:
    """A neck in SI: the input of every calculation of ``anglecam neck``."""

    parameters: NeckParameters
    large_angle: LargeAngleNeck
    scale: CommandScale
    """From the 8-bit command to the servo angle."""
    turning: TurningMechanism
    bearing: ThrustBearing
    film: OilFilm
    example: NeckParameters
    """The neck that the design procedure starts from."""
    known: CorrelatedQuantities
    """What the design procedure takes as known; see `anglecam.neck.design.known`."""


class _LinkageKeys(Declared):
    ground_m: Positive = PAPER.linkage.ground
    coupler_m: Positive = PAPER.linkage.coupler
    rocker_m: Positive = PAPER.linkage.rocker
    crank_m: Positive = PAPER.linkage.crank


class _ServoKeys(Declared):
    motor_constant_N_m_per_A: Positive = PAPER.servo.motor_constant
    amplifier_gain: Positive = PAPER.servo.amplifier_gain
    gear_ratio: Positive = PAPER.servo.gear_ratio
    output_impedance_ohm: Positive = PAPER.servo.output_impedance
    sensor_gain_V_per_rad: NotNegative = PAPER.servo.sensor_gain
    rotor_inertia_kg_m2: NotNegative = PAPER.servo.rotor_inertia
    command_gain_V_per_rad: Positive = PAPER.servo.command_gain


class _HeadKeys(Declared):
    mass_kg: Positive = PAPER.head.mass
    centre_of_mass_m: Positive = PAPER.head.centre_of_mass
    own_inertia_kg_m2: NotNegative = PAPER.head.own_inertia
    neutral_deg: Angle = math.degrees(PAPER.head.neutral)
    gravity_m_per_s2: NotNegative = PAPER.head.gravity


class _SpringKeys(Declared):
    rate_N_per_m: Positive = PAPER.spring.rate
    base_m: Positive = PAPER.spring.base
    arm_m: Positive = PAPER.spring.arm
    common_stretch_m: NotNegative | None = None
    """Of two springs that oppose each other; null for the paper's single spring, which can also push."""
    pretension_error_N_m: Finite = 0.0
    """Torque at neutral by which the springs exceed the head's weight."""


class _TurningKeys(Declared):
    crank_m: Positive = TurningMechanism.crank
    distance_m: Positive = TurningMechanism.distance
    offset_m: Finite = TurningMechanism.offset
    travel_deg: Annotated[float, Field(gt=0, le=180)] = math.degrees(TurningMechanism.travel)


class _BearingKeys(Declared):
    friction: NotNegative = ThrustBearing.friction
    bore_m: Positive = ThrustBearing.bore


class _FilmKeys(Declared):
    viscosity_N_s_per_m2: Positive = OilFilm.viscosity
    diameter_m: Positive = OilFilm.diameter
    width_m: Positive = OilFilm.width
    thickness_m: Positive = OilFilm.thickness


class _CommandKeys(Declared):
    up_deg_per_count: Positive = math.degrees(TABLE_3.up)
    down_deg_per_count: Positive = math.degrees(TABLE_3.down)


class _SigmaKeys(Declared):
    """Standard uncertainties of the known quantities, in the units of the keys; the others count as exact."""

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
"""Symbol in `anglecam.neck.design.known` of each key of `_SigmaKeys`."""


class NeckFile(Declared):
    """The keys of a neck file."""

    linkage: _LinkageKeys = _LinkageKeys()
    servo: _ServoKeys = _ServoKeys()
    head: _HeadKeys | None = None
    spring: _SpringKeys = _SpringKeys()
    damping_N_m_s: NotNegative | None = None
    gamma: Slope | None = None
    """Slope dθ_f/dθ_s. Default: the line fitted over the nod where links are declared, else the paper's −0.36."""
    linkage_slope: Literal["constant", "exact"] = "constant"
    """Whether γ of Eq. (31) is constant or follows the four-bar."""
    turning: _TurningKeys = _TurningKeys()
    bearing: _BearingKeys = _BearingKeys()
    film: _FilmKeys = _FilmKeys()
    command: _CommandKeys = _CommandKeys()
    sigma: _SigmaKeys = _SigmaKeys()


def read_neck(path: Path | None) -> DeclaredNeck:
    """Read a neck file; without a path, return the paper's neck.

    Parameters
    ----------
    path : Path or None
        A YAML file; see `NeckFile` and ``configs/necks/paper.yaml``.

    Returns
    -------
    DeclaredNeck
        In SI.

    Raises
    ------
    RigError
        With the file, the key and the cause; also where the declared links cannot close at any angle.
    """
    if path is None:
        return neck_of(NeckFile())
    declared = read_declared(path, NeckFile)
    try:
        return neck_of(declared)
    except ValueError as fault:
        raise RigError(f"{path}: {fault}") from fault


def neck_of(declared: NeckFile) -> DeclaredNeck:
    """Return the neck that a file declares, in SI; see `read_neck`."""
    links, servo, spring, turning = declared.linkage, declared.servo, declared.spring, declared.turning
    linkage = FourBar(links.ground_m, links.coupler_m, links.rocker_m, links.crank_m)
    gamma = declared.gamma
    if gamma is None:
        gamma = PAPER.gamma if linkage == PAPER.linkage else nod_slope(linkage)
    parameters = NeckParameters(
        servo=ServoParameters(
            motor_constant=servo.motor_constant_N_m_per_A,
            amplifier_gain=servo.amplifier_gain,
            gear_ratio=servo.gear_ratio,
            output_impedance=servo.output_impedance_ohm,
            sensor_gain=servo.sensor_gain_V_per_rad,
            rotor_inertia=servo.rotor_inertia_kg_m2,
            command_gain=servo.command_gain_V_per_rad,
        ),
        head=_head(declared.head or _HeadKeys()),
        spring=SpringParameters(spring.rate_N_per_m, spring.base_m, spring.arm_m),
        linkage=linkage,
        damping=PAPER.damping if declared.damping_N_m_s is None else declared.damping_N_m_s,
        gamma=gamma,
    )
    oil = declared.film
    film = OilFilm(oil.viscosity_N_s_per_m2, oil.diameter_m, oil.width_m, oil.thickness_m)
    example = _example(declared, parameters, film)
    return DeclaredNeck(
        parameters=parameters,
        large_angle=LargeAngleNeck(
            parameters, declared.linkage_slope, spring.common_stretch_m, spring.pretension_error_N_m
        ),
        scale=CommandScale(
            up=math.radians(declared.command.up_deg_per_count), down=math.radians(declared.command.down_deg_per_count)
        ),
        turning=TurningMechanism(
            turning.crank_m, turning.distance_m, turning.offset_m, math.radians(turning.travel_deg)
        ),
        bearing=ThrustBearing(declared.bearing.friction, declared.bearing.bore_m),
        film=film,
        example=example,
        known=_known(declared, example),
    )


def _head(keys: _HeadKeys) -> HeadParameters:
    return HeadParameters(
        keys.mass_kg,
        keys.centre_of_mass_m,
        keys.own_inertia_kg_m2,
        math.radians(keys.neutral_deg),
        keys.gravity_m_per_s2,
    )


def _example(declared: NeckFile, neck: NeckParameters, film: OilFilm) -> NeckParameters:
    """Replace what is not declared by the paper's design example."""
    if declared.damping_N_m_s is None:
        neck = replace(neck, damping=film.damping)
    if declared.head is None:
        neck = replace(neck, head=replace(neck.head, mass=EXAMPLE_MASS))
    return neck


def _known(declared: NeckFile, neck: NeckParameters) -> CorrelatedQuantities:
    errors = {_SYMBOLS[key]: value for key, value in declared.sigma.model_dump().items()}
    errors["theta_0"] = math.radians(errors["theta_0"])
    taken = known(neck, errors)
    return taken.replaced(inertia=UncertainValue(EXAMPLE_INERTIA)) if declared.head is None else taken
