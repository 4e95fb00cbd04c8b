"""``anglecam neck pd``: closed loops for every pair of gains, and tuned gains, Eq. (37) and Fig. 16."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from anglecam.io.neck_file import DeclaredNeck
from anglecam.neck.pd import ClosedLoop, PdGains, PdMotion, close_loop, gains_table
from anglecam.neck.pd_tuning import NodTarget, Tuned, tune_pd
from anglecam.neck_design.procedure import ControlledPlant, simulated_loop
from anglecam.neck_design.render import Layout, Rows
from anglecam.neck_design.results.constraint import ConstraintRow, constraint_row, constraint_table
from anglecam.neck_design.results.demand import saturation_notes
from anglecam.neck_design.results.step import LargeAngleStep, Step, step_of
from anglecam.neck_design.text import gain
from anglecam.neck_design.units import (
    DECIBEL,
    INLINE,
    INTERNAL,
    ONE,
    OPTIONAL,
    Angle,
    Column,
    Share,
    Time,
    WithUnit,
)


@dataclass(frozen=True)
class LoopRow:
    """A closed loop; its gains are in the unit of the plant's input over that of its output."""

    proportional: Annotated[float, Column("K_p, {proportional}", _proportional_text)]
    """K_p."""
    derivative: Annotated[Time, Column("K_d, {derivative_s}", _derivative_text)]
    """K_d, s times the unit of K_p."""
    step: Annotated[Step, INLINE]
    steady_state: Annotated[WithUnit, Column("steady state, {output}", 3)]
    """Of a step of height 1."""
    loss: Annotated[Share, Column("lost, %", 1)]
    """Share of the steady state that control takes away."""
    gain_margin: Annotated[float, ONE, DECIBEL]
    phase_margin: Annotated[Angle, Column("margin, °", 0)]
    delay_margin: Time
    modulus_margin: float
    sensitivity: Annotated[float, Column("M_s", 2)]


def _proportional_text(loop: LoopRow) -> str:
    return gain(loop.proportional)


def _derivative_text(loop: LoopRow) -> str:
    return gain(loop.derivative)


@dataclass(frozen=True)
class TargetFacts:
    """The nod to which the gains were tuned."""

    rise_time: Time
    overshoot: Share


@dataclass(frozen=True)
class TunedLoop:
    """The loop with the tuned gains."""

    loop: Annotated[LoopRow, INLINE]
    wanted: TargetFacts
    feasible: bool
    unmet: tuple[str, ...]
    constraints: tuple[ConstraintRow, ...]


@dataclass(frozen=True)
class PdCurves:
    """What the figures of ``anglecam neck pd`` draw."""

    plant: ControlledPlant
    loops: tuple[ClosedLoop, ...]
    uncontrolled: ClosedLoop
    tuned: Tuned | None
    simulated: PdMotion | None
    """The tuned gains on the neck at large angles."""


@dataclass(frozen=True)
class Pd:
    """Result of ``anglecam neck pd``."""

    plant: str
    gains_of: str
    gain_units: Mapping[str, str]
    steady_state_unit: str
    loops: tuple[LoopRow, ...]
    tuned: Annotated[TunedLoop | None, OPTIONAL]
    large_angles: Annotated[LargeAngleStep | None, OPTIONAL]
    notes: Annotated[tuple[str, ...], INTERNAL]
    curves: Annotated[PdCurves, INTERNAL]

    def tables(self) -> list[Layout]:
        """Return the loops and, if gains were tuned, the tuned loop with its constraints."""
        headings = {**self.gain_units, "output": self.steady_state_unit}
        tables: list[Layout] = [Rows(self.loops, 0, headings, f"{self.plant}; {self.gains_of}")]
        if self.tuned is not None:
            tables.append(Rows([self.tuned.loop], 0, headings, f"tuned, {self.plant}"))
            tables.append(constraint_table(self.tuned.constraints))
        if self.large_angles is not None:
            tables.append(self.large_angles.facts())
        return tables

    def remarks(self) -> tuple[str, ...]:
        """Return what tuning could not meet and where the motor saturates."""
        return self.notes


def pd_of(
    plant: ControlledPlant,
    proportional: Sequence[float],
    derivative: Sequence[float],
    target: NodTarget | None = None,
    *,
    largest_loss: float = 0.05,
    neck: DeclaredNeck | None = None,
) -> Pd:
    """Close PD loops around a plant and, if a nod is wanted, tune the gains to it.

    Parameters
    ----------
    plant : ControlledPlant
        To control.
    proportional, derivative : sequence of float
        K_p and K_d, in the plant's units; a loop is closed for each pair.
    target : NodTarget, optional
        The wanted nod.
    largest_loss : float
        Share of the steady state that tuned gains may take away.
    neck : DeclaredNeck, optional
        The neck that the plant linearises; the tuned gains are then simulated at large angles too.

    Returns
    -------
    Pd
        For the renderer and the figures.

    Raises
    ------
    ValueError
        If the plant cannot be controlled or tuned.
    """
    loops = gains_table(plant.transfer, proportional, derivative)
    tuned = simulated = None
    notes: list[str] = []
    if target is not None:
        tuned = tune_pd(plant.transfer, target, largest_loss=largest_loss)
        notes += tuned.unmet
        if neck is not None:
            try:
                simulated = simulated_loop(neck.large_angle, tuned.loop)
                needed = neck.parameters.servo.amplifier_gain * float(simulated.voltage[0])
                notes += saturation_notes(needed, "at the step's start: Eq. (31) has no such limit")
            except ValueError as refusal:
                notes.append(f"at large angles, Eq. (31): {refusal}")
    return Pd(
        plant=plant.name,
        gains_of=plant.gains_of,
        gain_units={"proportional": plant.gain_unit, "derivative_s": plant.rate_unit},
        steady_state_unit=plant.output.symbol,
        loops=tuple(_loop_row(loop, plant) for loop in loops),
        tuned=None if tuned is None else _tuned_loop(tuned, plant),
        large_angles=None if simulated is None else _large_angle_step(simulated),
        notes=tuple(notes),
        curves=PdCurves(plant, loops, close_loop(plant.transfer, PdGains()), tuned, simulated),
    )


def _loop_row(loop: ClosedLoop, plant: ControlledPlant) -> LoopRow:
    margins = loop.margins
    return LoopRow(
        proportional=loop.gains.proportional,
        derivative=loop.gains.derivative,
        step=step_of(loop.figures),
        steady_state=WithUnit(loop.figures.steady_state, plant.output),
        loss=loop.loss,
        gain_margin=margins.gain,
        phase_margin=margins.phase,
        delay_margin=margins.delay,
        modulus_margin=margins.modulus,
        sensitivity=margins.sensitivity,
    )


def _tuned_loop(tuned: Tuned, plant: ControlledPlant) -> TunedLoop:
    return TunedLoop(
        loop=_loop_row(tuned.loop, plant),
        wanted=TargetFacts(tuned.wanted.rise_time, tuned.wanted.overshoot),
        feasible=tuned.feasible,
        unmet=tuned.unmet,
        constraints=tuple(constraint_row(c) for c in tuned.constraints),
    )


def _large_angle_step(motion: PdMotion) -> LargeAngleStep:
    return LargeAngleStep(
        step=step_of(motion.figures),
        steady_state=motion.figures.steady_state,
        peak_voltage=float(np.abs(motion.voltage).max()),
    )
