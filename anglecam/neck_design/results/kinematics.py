"""``anglecam neck kinematics``: four-bar and turning mechanism, Table 3, limits and the commands of wanted nods."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from anglecam.io.neck_file import DeclaredNeck
from anglecam.neck.command_table import (
    STRAIGHT,
    NeckPosition,
    command_of_nod,
    nod_limits,
    nod_of_command,
    resolution,
    servo_of_command,
    table_3,
)
from anglecam.neck.fourbar import head_angle, servo_angle
from anglecam.neck.parameters import PAPER
from anglecam.neck.transmission import limits, slope, straight_line, transmission_angle, worst_transmission_angle
from anglecam.neck.turning import (
    bearing_torque,
    slider,
    turning_range,
    turning_servo_angle,
    turning_slope,
    turning_start_torque,
)
from anglecam.neck.variation import NOD, nod_range, nod_slope
from anglecam.neck_design.render import Facts, Layout, Rows
from anglecam.neck_design.text import degree_range, degrees, number, torque
from anglecam.neck_design.units import (
    INTERNAL,
    Angle,
    Angles,
    Column,
    Length,
    TorqueInBothUnits,
    Unit,
)


@dataclass(frozen=True)
class Table3Row:
    """A row of Table 3, with what the links do there."""

    position: Annotated[str, Column("Table 3")]
    counts: Annotated[int, Column("counts", "+d")]
    """From neutral."""
    command: Annotated[int, Column("command")]
    """0 to 254."""
    theta_s: Annotated[Angle, Column("θ_s, °", 1)]
    theta_a: Angle
    """Servo angle from neutral."""
    theta_f: Annotated[Angle, Column("θ_f exact, °", 2)]
    nod: Annotated[Angle, Column("Δθ exact, °", 2)]
    theta_f_line: Annotated[Angle, Column("θ_f line, °", 2)]
    """From the straight line of Fig. 4."""
    nod_line: Annotated[Angle, Column("Δθ line, °", 2)]
    slope: Annotated[float, Column("γ exact", 3)]
    transmission_angle: Annotated[Angle, Column("μ, °", 1)]
    resolution: Annotated[float, Unit("deg_per_count", "°/count", math.degrees), Column("°/count", 3)]


@dataclass(frozen=True)
class FittedLine:
    """The straight line of Fig. 4."""

    slope: float
    intercept: Angle
    r_squared: float
    range: Angles
    """θ_s over which it was fitted."""


@dataclass(frozen=True)
class NoddingLimits:
    """How far links and commands let the head nod."""

    grashof: str
    theta_f: Angles
    """Between the dead centres."""
    theta_s: Angles
    nod: Angles
    """That commands reach."""


@dataclass(frozen=True)
class WorstTransmission:
    """Where between Table 3's extremes the transmission angle is farthest from 90°."""

    theta_s: Angle
    transmission_angle: Angle


@dataclass(frozen=True)
class WantedNod:
    """A wanted nod, the command nearest to it and the nod that this command gives."""

    nod: Annotated[Angle, Column("wanted nod, °", 2)]
    theta_s: Annotated[Angle, Column("θ_s for it, °", 2)]
    command: Annotated[int, Column("command")]
    theta_s_of_command: Annotated[Angle, Column("its θ_s, °", 2)]
    nod_of_command: Annotated[Angle, Column("its nod, °", 2)]
    error: Annotated[Angle, Column("off by, °", 3)]


@dataclass(frozen=True)
class TurningFacts:
    """What the turning mechanism reaches."""

    range: Angles
    slope_at_ends_and_neutral: tuple[float, ...]
    """dφ/ds at the lower end, at neutral and at the upper end."""
    slot: Length
    """Least length of the slot."""


@dataclass(frozen=True)
class BearingTorque:
    """Friction of the thrust bearing, Eq. (4)."""

    torque: TorqueInBothUnits
    start_torque: TorqueInBothUnits


@dataclass(frozen=True)
class Kinematics:
    """Result of ``anglecam neck kinematics``."""

    table_3: tuple[Table3Row, ...]
    line: FittedLine
    gamma: float
    """γ of the equations of motion."""
    gamma_from: str
    limits: NoddingLimits
    worst_transmission_angle: WorstTransmission
    wanted: tuple[WantedNod, ...]
    turning: TurningFacts
    bearing: BearingTorque
    notes: tuple[str, ...]
    neck: Annotated[DeclaredNeck, INTERNAL]

    def tables(self) -> list[Layout]:
        """Return Table 3, the facts of the mechanism and, if any, the wanted nods."""
        line, worst, turning = self.line, self.worst_transmission_angle, self.turning
        ends, neutral, _ = turning.slope_at_ends_and_neutral
        facts = [
            (
                "straight line, Fig. 4",
                f"θ_f = {number(line.slope, 4)}·θ_s + {degrees(line.intercept)}, R² = {number(line.r_squared, 4)} "
                f"over θ_s = {degree_range(line.range, 0)}",
            ),
            ("γ of the equations of motion", f"{number(self.gamma, 4)}, {self.gamma_from}"),
            ("class of the linkage (Grashof)", self.limits.grashof),
            ("θ_f between dead centres", degree_range(self.limits.theta_f)),
            ("θ_s between dead centres", degree_range(self.limits.theta_s)),
            ("nod that commands reach", degree_range(self.limits.nod)),
            (
                "worst transmission angle",
                f"μ = {degrees(worst.transmission_angle, 1)} at θ_s = {degrees(worst.theta_s, 1)}",
            ),
            ("turning range", degree_range(turning.range)),
            ("turning slope dφ/ds", f"{number(neutral, 3)} at neutral, {number(ends, 3)} at the ends"),
            ("slot of the turning mechanism", f"{number(1e3 * turning.slot, 1)} mm"),
            ("bearing torque, Eq. (4)", torque(self.bearing.torque)),
            ("starting torque of the bearing", torque(self.bearing.start_torque)),
        ]
        return [
            Rows(self.table_3),
            Facts("mechanism", facts),
            *([Rows(self.wanted, words=0)] if self.wanted else []),
        ]

    def remarks(self) -> tuple[str, ...]:
        """Return the notes."""
        return self.notes


def kinematics_of(neck: DeclaredNeck, wanted: Sequence[float] = ()) -> Kinematics:
    """Compute Table 3, the line of Fig. 4, limits, transmission angle, resolution and the turning mechanism.

    Parameters
    ----------
    neck : DeclaredNeck
        Its links, command scale, turning mechanism and bearing.
    wanted : sequence of float
        Nods whose command is wanted, rad.

    Returns
    -------
    Kinematics
        For the renderer and the figures.

    Raises
    ------
    ValueError
        If the links cannot close, or a wanted nod is beyond their reach.
    """
    linkage, scale = neck.parameters.linkage, neck.scale
    positions = table_3(linkage, scale)
    line, found = straight_line(linkage, *STRAIGHT), limits(linkage)
    worst = worst_transmission_angle(linkage, positions[2].theta_s, positions[0].theta_s)
    beyond = [row for row in positions if not found.crank[0] <= row.theta_s <= found.crank[1]]
    return Kinematics(
        table_3=tuple(_table_3_row(neck, position) for position in positions),
        line=FittedLine(line.slope, line.intercept, line.r_squared, STRAIGHT),
        gamma=neck.parameters.gamma,
        gamma_from=_origin_of_gamma(neck),
        limits=NoddingLimits(found.kind, found.rocker, found.crank, nod_limits(linkage, scale)),
        worst_transmission_angle=WorstTransmission(worst.theta_s, worst.mu),
        wanted=tuple(_wanted_nod(neck, nod) for nod in wanted),
        turning=_turning_facts(neck),
        bearing=_bearing_torque(neck),
        notes=tuple(
            f"Table 3's command {row.command} ({row.position}) turns the servo to {math.degrees(row.theta_s):.1f}°, "
            f"beyond a dead centre of the links, where the head has turned back"
            for row in beyond
        ),
        neck=neck,
    )


def _table_3_row(neck: DeclaredNeck, row: NeckPosition) -> Table3Row:
    linkage = neck.parameters.linkage
    return Table3Row(
        position=row.position,
        counts=row.counts,
        command=row.command,
        theta_s=row.theta_s,
        theta_a=row.theta_a,
        theta_f=row.theta_f,
        nod=row.nod,
        theta_f_line=row.theta_f_line,
        nod_line=row.nod_line,
        slope=float(slope(linkage, row.theta_s)),
        transmission_angle=float(transmission_angle(linkage, row.theta_s)),
        resolution=float(resolution(row.command, linkage, neck.scale)),
    )


def _origin_of_gamma(neck: DeclaredNeck) -> str:
    linkage, gamma = neck.parameters.linkage, neck.parameters.gamma
    if math.isclose(gamma, nod_slope(linkage), rel_tol=1e-9):
        low, high = np.degrees(nod_range(linkage))
        return f"line fitted over a nod of ±{math.degrees(NOD):.0f}°, θ_s from {low:.1f}° to {high:.1f}°"
    return "printed by the paper, over Fig. 4's range of θ_s" if gamma == PAPER.gamma else "declared"


def _wanted_nod(neck: DeclaredNeck, nod: float) -> WantedNod:
    linkage, scale = neck.parameters.linkage, neck.scale
    command = int(command_of_nod(nod, linkage, scale))
    reached = float(nod_of_command(command, linkage, scale))
    return WantedNod(
        nod=nod,
        theta_s=float(servo_angle(linkage, float(head_angle(linkage, scale.neutral)) - nod)),
        command=command,
        theta_s_of_command=float(servo_of_command(command, scale)),
        nod_of_command=reached,
        error=reached - nod,
    )


def _turning_facts(neck: DeclaredNeck) -> TurningFacts:
    mechanism = neck.turning
    low, high = turning_range(mechanism)
    ends = turning_servo_angle(mechanism, [low, 0.0, high])
    return TurningFacts(
        range=(low, high),
        slope_at_ends_and_neutral=tuple(turning_slope(mechanism, ends).tolist()),
        slot=float(np.ptp(slider(mechanism, np.linspace(ends[0], ends[2], 361)))),
    )


def _bearing_torque(neck: DeclaredNeck) -> BearingTorque:
    head = neck.parameters.head
    running = bearing_torque(head.mass * head.gravity, neck.bearing.friction, neck.bearing.bore)
    return BearingTorque(running, turning_start_torque(running))
