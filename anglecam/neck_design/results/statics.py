"""``anglecam neck statics``: spring against weight, pretension, and the torque left to the servo, Eqs. (22)-(25)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from anglecam.io.neck_file import DeclaredNeck
from anglecam.neck.command_table import nod_limits
from anglecam.neck.damping import SAE_20_VISCOSITY
from anglecam.neck.large_angle import holding_voltage
from anglecam.neck.linear import linear_neck, passive_stiffness
from anglecam.neck.servo import torque_speed
from anglecam.neck.statics import neutral_angle, pretension, pretension_angle, slack_limit, static_curve
from anglecam.neck_design.render import Facts, Layout, Rows
from anglecam.neck_design.results.demand import SUPPLY, ServoDemand, servo_demand
from anglecam.neck_design.results.step import UNSTABLE
from anglecam.neck_design.text import degrees, number, rounded, torque
from anglecam.neck_design.units import (
    INTERNAL,
    OPTIONAL,
    Angle,
    Column,
    DampingConstant,
    Length,
    Torque,
    TorqueInBothUnits,
    Unit,
    Voltage,
)

EVERY = math.radians(5.0)
"""Distance between the angles at which spring and weight are tabulated, rad."""


@dataclass(frozen=True)
class SpringFacts:
    """The springs at neutral."""

    stiffness: Torque
    """K·L2·L6, per rad."""
    stretch_behind: Length
    stretch_before: Length | None
    """None for the paper's single spring."""
    least_common_stretch: Length
    """With which neither of two springs goes slack over the range of the nod."""


@dataclass(frozen=True)
class WeightFacts:
    """The weight about the pivot."""

    moment: TorqueInBothUnits
    """M_h·g·L."""
    at_neutral: Torque
    """M_h·g·L·sin θ0."""


@dataclass(frozen=True)
class ServoFacts:
    """The servo at its supply."""

    torque_gain: Annotated[float, Unit("N_m_per_V", "N·m/V")]
    """c3."""
    supply: Voltage
    stall_torque: Torque
    no_load_speed: Annotated[float, Unit("rad_per_s", "rad/s")]


@dataclass(frozen=True)
class FilmFacts:
    """Damping of the oil film, Eq. (22), with the paper's viscosity and with that of SAE 20 oil."""

    damping: DampingConstant
    damping_of_SAE_20: DampingConstant  # noqa: N815 - the oil's name


@dataclass(frozen=True)
class CurvePoint:
    """Spring, weight and servo at one angle."""

    nod: Annotated[Angle, Column("Δθ, °", 0)]
    spring: Annotated[Torque, Column("spring, N·m", 3)]
    weight: Annotated[Torque, Column("weight, N·m", 3)]
    residual: Annotated[Torque, Column("left to the servo, N·m", 3)]
    """Eq. (23)."""
    small_angle: Annotated[Torque, Column("small angles, N·m", 3)]
    """Eq. (25)."""
    holding_voltage: Annotated[Voltage, Column("held by, V", 3)]
    torque_at_shaft: Annotated[Torque, Column("at the shaft, N·m", 3)]


@dataclass(frozen=True)
class WantedPretension:
    """A pretension angle and where the head then rests."""

    pretension_angle: Angle
    """θ_p, from upright."""
    neutral: Angle
    """From the declared neutral."""


@dataclass(frozen=True)
class Statics:
    """Result of ``anglecam neck statics``."""

    spring: SpringFacts
    weight: WeightFacts
    stiffness_of_spring_and_weight: Torque
    """K·L2·L6 − M_h·g·L·cos θ0 of Eq. (25), per rad."""
    pretension_angle: Angle
    """θ_p of Eq. (24), from upright."""
    torque_at_neutral: Torque
    neutral: Angle
    """Where the head rests, from neutral."""
    servo: ServoFacts
    demand: ServoDemand
    film: FilmFacts
    curve: tuple[CurvePoint, ...]
    notes: tuple[str, ...]
    wanted: Annotated[WantedPretension | None, OPTIONAL]
    neck: Annotated[DeclaredNeck, INTERNAL]

    def tables(self) -> list[Layout]:
        """Return the facts and the curve of spring against weight."""
        spring, weight, servo, film, before = (
            self.spring,
            self.weight,
            self.servo,
            self.film,
            self.spring.stretch_before,
        )
        facts = [
            ("spring K·L2·L6", f"{number(spring.stiffness, 3)} N·m/rad"),
            ("weight M_h·g·L", torque(weight.moment)),
            ("weight at neutral", f"{number(weight.at_neutral, 3)} N·m"),
            ("spring and weight, Eq. (25)", f"{number(self.stiffness_of_spring_and_weight, 3)} N·m/rad"),
            ("pretension angle θ_p, Eq. (24)", f"{degrees(self.pretension_angle)} from upright"),
            (
                "stretch at neutral",
                f"{number(1e3 * spring.stretch_behind, 2)} mm"
                + ("" if before is None else f" behind, {number(1e3 * before, 2)} mm before"),
            ),
            ("where two springs stay taut", f"common stretch ≥ {number(1e3 * spring.least_common_stretch, 1)} mm"),
            ("torque left at neutral", f"{number(self.torque_at_neutral, 3)} N·m"),
            ("head rests at", f"{degrees(self.neutral)} from neutral"),
            (
                f"servo at {number(servo.supply, 0)} V",
                f"stall torque {number(servo.stall_torque, 3)} N·m, c3 = {number(servo.torque_gain, 3)} N·m/V",
            ),
            self.demand.fact(),
            (
                "damping C of the film, Eq. (22)",
                f"{rounded(film.damping):.3g} N·m·s; with SAE 20 oil {rounded(film.damping_of_SAE_20):.2g} N·m·s",
            ),
        ]
        if self.wanted is not None:
            facts.append(
                (
                    f"with θ_p = {degrees(self.wanted.pretension_angle)}",
                    f"it rests at {degrees(self.wanted.neutral)} from neutral",
                )
            )
        return [Facts("statics", facts), Rows(self.curve, words=0)]

    def remarks(self) -> tuple[str, ...]:
        """Return the notes."""
        return self.notes


def statics_of(neck: DeclaredNeck, theta_p: float | None = None) -> Statics:
    """Compute the static balance: pretension, spring against weight, and the torque left to the servo.

    Parameters
    ----------
    neck : DeclaredNeck
        Its springs, head, servo and oil film.
    theta_p : float, optional
        A pretension angle, rad from upright, for which to find neutral.

    Returns
    -------
    Statics
        For the renderer and the figure.

    Raises
    ------
    ValueError
        If nothing balances the head.
    """
    p, large = neck.parameters, neck.large_angle
    lowest, highest = nod_limits(p.linkage, neck.scale)
    delta = EVERY * np.arange(math.ceil(lowest / EVERY), math.floor(highest / EVERY) + 1)
    curve = static_curve(p, large.preload, delta)
    voltage = holding_voltage(large, delta)
    servo = torque_speed(p.servo, SUPPLY / p.servo.amplifier_gain)
    at_shaft = np.abs(large.ratio.slope(delta) * curve.residual)
    hardest = int(np.nanargmax(at_shaft))
    demand = servo_demand(p, delta[hardest], at_shaft[hardest], np.abs(curve.residual).max())
    columns = (delta, curve.spring, curve.weight, curve.residual, curve.small_angle, voltage, at_shaft)
    wanted = None
    if theta_p is not None:
        stretched = pretension(p, theta_p, common=large.common_stretch)
        wanted = WantedPretension(theta_p, neutral_angle(p, stretched))
    return Statics(
        spring=SpringFacts(
            stiffness=p.spring.rate * p.spring.base * p.spring.arm,
            stretch_behind=large.preload.behind,
            stretch_before=large.preload.before,
            least_common_stretch=slack_limit(p.spring, lowest, highest),
        ),
        weight=WeightFacts(p.head.weight_moment, p.head.weight_moment * math.sin(p.head.neutral)),
        stiffness_of_spring_and_weight=passive_stiffness(p),
        pretension_angle=pretension_angle(p),
        torque_at_neutral=large.pretension_error,
        neutral=neutral_angle(p, large.preload),
        servo=ServoFacts(p.servo.torque_gain, SUPPLY, servo.stall_torque, servo.no_load_speed),
        demand=demand,
        film=FilmFacts(neck.film.damping, replace(neck.film, viscosity=SAE_20_VISCOSITY).damping),
        curve=tuple(CurvePoint(*map(float, row)) for row in zip(*columns, strict=True)),
        notes=(*(() if linear_neck(p).stiffness > 0.0 else (UNSTABLE,)), *demand.notes()),
        wanted=wanted,
        neck=neck,
    )
