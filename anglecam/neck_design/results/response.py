"""``anglecam neck response``: the paper's models and a fitted one, stepped side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from anglecam.data.typing import Floats
from anglecam.neck.linear import linear_neck
from anglecam.neck.parameters import PAPER, NeckParameters
from anglecam.neck_design.render import Layout, Rows
from anglecam.neck_design.results.demand import saturation_notes
from anglecam.neck_design.results.step import UNSTABLE, Step, step_of
from anglecam.neck_design.systems import ComparedModel, SideBySide
from anglecam.neck_design.text import degrees
from anglecam.neck_design.units import DEGREE, INLINE, INTERNAL, OPTIONAL, Angle, Column


@dataclass(frozen=True)
class ModelRow:
    """One model's response to the step."""

    name: Annotated[str, Column("model")]
    equation: Annotated[str, Column("step of {height}")]
    step: Annotated[Step, INLINE]
    gain: float
    """Angle at rest per command."""
    steady_state: Annotated[Angle, Column("comes to rest at, °", 2)]
    numerator: Annotated[tuple[float, ...] | None, OPTIONAL]
    """Of the transfer function, highest power first; None for a model that is not linear."""
    denominator: Annotated[tuple[float, ...] | None, OPTIONAL]
    measured_rmse: Annotated[float | None, DEGREE, OPTIONAL, Column("off the measured, ° RMS", 3)]
    """Against the measured series; None without one."""


@dataclass(frozen=True)
class Response:
    """Result of ``anglecam neck response``."""

    step: Angle
    """Height."""
    models: tuple[ModelRow, ...]
    notes: tuple[str, ...]
    systems: Annotated[tuple[ComparedModel, ...], INTERNAL]
    measured_step: Annotated[tuple[Floats, Floats] | None, INTERNAL]
    """Time (s) and angle (rad) of a measured response without a command, if any."""
    runs: Annotated[SideBySide, INTERNAL]
    """The same models driven by a series of steps or by the command of a measurement."""

    def tables(self) -> list[Layout]:
        """Return a line for each model."""
        return [Rows(self.models, words=2, placeholders={"height": degrees(self.step, 1)})]

    def remarks(self) -> tuple[str, ...]:
        """Return the notes."""
        return self.notes


def response_of(
    systems: Sequence[ComparedModel],
    height: float,
    runs: SideBySide,
    measured_step: tuple[Floats, Floats] | None = None,
    neck: NeckParameters = PAPER,
) -> Response:
    """Compare the step responses of models.

    Parameters
    ----------
    systems : sequence of ComparedModel
        To step.
    height : float
        Of the step, rad.
    runs : SideBySide
        The same models in a series of steps.
    measured_step : (time, angle), optional
        A measured response, s and rad, drawn over the step.
    neck : NeckParameters
        The neck that the models of Eqs. (28) and (31) describe.

    Returns
    -------
    Response
        For the renderer and the figures.
    """
    notes = () if linear_neck(neck).stiffness > 0.0 else (UNSTABLE,)
    # the error is the whole input while the head has not moved
    saturated = saturation_notes(
        neck.servo.amplifier_gain * neck.servo.command_gain * height,
        "at the step's start: the models have no such limit",
    )
    return Response(
        step=height,
        models=tuple(_model_row(system, height, runs.rmse.get(system.name)) for system in systems),
        notes=(*notes, *saturated),
        systems=tuple(systems),
        measured_step=measured_step,
        runs=runs,
    )


def _model_row(system: ComparedModel, height: float, rmse: float | None) -> ModelRow:
    figures = system.figures(height)
    numerator, denominator = (None, None) if system.transfer is None else system.transfer
    return ModelRow(
        name=system.name,
        equation=system.equation,
        step=step_of(figures),
        gain=figures.steady_state,
        steady_state=figures.steady_state * height,
        numerator=None if numerator is None else tuple(map(float, numerator)),
        denominator=None if denominator is None else tuple(map(float, denominator)),
        measured_rmse=rmse,
    )
