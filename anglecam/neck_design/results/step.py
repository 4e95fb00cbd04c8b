"""Figures of a step response, as every verb that steps a neck reports them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from anglecam.data.step_figures import StepFigures
from anglecam.neck_design.render import Facts
from anglecam.neck_design.text import degrees, number
from anglecam.neck_design.units import INLINE, Angle, Column, Share, Time, Unit, Voltage

UNSTABLE = "the neck is unstable, Eq. (35): it falls from neutral, so its response has no figures"


@dataclass(frozen=True)
class Step:
    """Rise, overshoot and settling with the keys of ``model.json``; NaN where the response does not come to rest."""

    rise_time: Annotated[Time, Column("rise, s", 3)]
    overshoot: Annotated[Share, Column("overshoot, %", 1)]
    settling_time: Annotated[Time, Column("settling, s", 3)]

    def __str__(self) -> str:
        rise, overshoot, settling = self.cells()
        return f"rise {rise} s, overshoot {overshoot} %, settling {settling} s"

    def cells(self) -> tuple[str, str, str]:
        """Return the three figures as a table shows them: s, % and s."""
        return number(self.rise_time, 3), number(100.0 * self.overshoot, 1), number(self.settling_time, 3)


def step_of(figures: StepFigures) -> Step:
    """Return the figures without their steady state, whose unit differs between verbs."""
    return Step(figures.rise_time, figures.overshoot, figures.settling_time)


@dataclass(frozen=True)
class VoltageStep:
    """Response to a step of 1 V."""

    step: Annotated[Step, INLINE]
    gain: Annotated[float, Unit("rad_per_V", "rad/V")]
    """Angle at rest per volt."""


def voltage_step(figures: StepFigures) -> VoltageStep:
    """Return the figures of a response per volt."""
    return VoltageStep(step_of(figures), figures.steady_state)


@dataclass(frozen=True)
class LargeAngleStep:
    """Response at large angles, Eq. (31), with gains that were tuned on the linear model."""

    step: Annotated[Step, INLINE]
    steady_state: Angle
    peak_voltage: Voltage
    """Largest output of the controller."""

    def facts(self) -> Facts:
        """Return its table."""
        rise, overshoot, settling = self.step.cells()
        return Facts(
            "the same gains at large angles, Eq. (31)",
            [
                ("rise, overshoot, settling", f"{rise} s, {overshoot} %, {settling} s"),
                ("comes to rest at", degrees(self.steady_state)),
                ("peak of the controller", f"{number(self.peak_voltage, 3)} V"),
            ],
        )
