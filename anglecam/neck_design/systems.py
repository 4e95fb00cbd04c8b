"""The paper's models side by side, as in Figs. 10, 11, 14 and 15: SYS1, SYS2, Eqs. (28) and (31), and fitted ones.

Command and angle are both angles of the head. In Eqs. (28) and (31) the command enters through C_i of Eq. (29). The
input of SYS2 has no unit: a step of height 1 is the step that the paper commanded, after which the head rested at 22°.
Here a command of 22° stands for 1, and the model comes to rest at 23.58°.

The paper prints neither its measured curves nor the levels of the step series of Figs. 11 and 15. The levels of
`SERIES` are chosen here: several heights within the reach of the links, each step starting where the previous one
ended.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from anglecam.data.command import Command
from anglecam.data.record import Record, record_from_series
from anglecam.data.step_figures import NO_STEP, StepFigures
from anglecam.data.typing import Floats
from anglecam.identification.export import FittedModel
from anglecam.io.series_csv import read_series
from anglecam.io.session import command_beside, rig_beside
from anglecam.measurement.step_response import responses
from anglecam.models.large_angle import LargeAngle
from anglecam.models.model import Model
from anglecam.models.plant import Plant
from anglecam.models.third_order import ThirdOrder
from anglecam.neck.large_angle import LargeAngleNeck, acceleration, equilibrium, linearise
from anglecam.neck.linear import linear_neck
from anglecam.neck.pd import PdGains, simulate_pd, sys2
from anglecam.neck.step import linear_step_figures

SYS1 = (25.9786, 523.7292, 507.5597)
"""a (1/s), b (1/s²) and c (1/s²) identified by the paper."""
STEP = np.radians(22.0)
"""The step of Figs. 10 and 14, rad."""
SERIES = Command(
    np.array([0.0, 0.5, *(0.5 + 1.5 * np.arange(1, 9))]),
    np.radians([0.0, 22.0, 0.0, 12.0, -8.0, 18.0, 5.0, -15.0, 10.0, 0.0]),
)
"""A command similar to those of Figs. 11 and 15."""
_TIME_CONSTANTS = 14.0
"""Time constants for which a neck at large angles is simulated until it rests."""


@dataclass(frozen=True)
class ComparedModel:
    """A model of the neck from command to angle."""

    name: str
    equation: str
    """Its equation in the paper, or the estimator that fitted it."""
    model: Model
    parameters: Floats
    """(p,) SI, in the order of ``model.names``."""
    transfer: tuple[Floats, Floats] | None
    """Numerator and denominator; ``None`` for a model that is not linear."""

    def run(self, time: Floats, command: Command) -> Floats:
        """Simulate the model from rest at neutral.

        Parameters
        ----------
        time : (n,) ndarray
            Instants, s, from the beginning of the command.
        command : Command
            Commanded head angle, rad.

        Returns
        -------
        (n,) ndarray
            Angle, rad; NaN once the head leaves the reach of its linkage.
        """
        return self.model.predict(self.parameters, time, command, np.zeros(self.model.states))

    def figures(self, height: float = STEP) -> StepFigures:
        """Return rise, overshoot, settling and the steady state per command for a step of a height, rad.

        All are NaN if the model does not come to rest.
        """
        if self.transfer is not None:
            return linear_step_figures(*self.transfer)
        assert isinstance(self.model, LargeAngle)
        try:
            figures = _large_angle_figures(self.model.neck_at(self.parameters), height)
        except ValueError:  # there is no equilibrium, or the head leaves the reach of its linkage
            return NO_STEP
        return replace(figures, steady_state=float(figures.steady_state) / height)


def _large_angle_figures(neck: LargeAngleNeck, height: float) -> StepFigures:
    """Return the figures of a simulated step, steady state in rad; raise `ValueError` if it cannot come to rest."""
    voltage = neck.parameters.servo.command_gain * height
    near = linearise(neck, equilibrium(neck, voltage))
    slowest = -float(np.roots([1.0, near.a, near.b]).real.max())
    if slowest <= 0.0:
        return NO_STEP
    motion = simulate_pd(
        lambda delta, omega, u: float(acceleration(neck, delta, omega, u)),
        PdGains(),
        voltage,
        _TIME_CONSTANTS / slowest,
    )
    return motion.figures


@dataclass(frozen=True)
class SideBySide:
    """Responses of models to the same command; arrays of length n."""

    time: Floats
    """s."""
    command: Command
    """rad."""
    systems: tuple[ComparedModel, ...]
    angles: tuple[Floats, ...]
    """Angle of each model, rad."""
    measured: Floats | None
    """rad."""
    rmse: dict[str, float]
    """RMS of measured minus simulated angle, rad, by the name of the model; empty without a measurement."""


def paper_systems(neck: LargeAngleNeck) -> tuple[ComparedModel, ...]:
    """Return SYS1, the neck by Eq. (28), SYS2 and the neck by Eq. (31).

    Parameters
    ----------
    neck : LargeAngleNeck
        The neck of both equations.

    Returns
    -------
    tuple of ComparedModel
        In that order.
    """
    linear = linear_neck(neck.parameters)
    gain = linear.c * neck.parameters.servo.command_gain
    third = sys2()
    above, below = third.num[0][0] / np.degrees(STEP), third.den[0][0]
    return (
        second_order("SYS1", "Eq. (30), identified", SYS1),
        second_order("small angles", "Eq. (28)", (linear.a, linear.b, gain)),
        ComparedModel("SYS2", "Eq. (36)", ThirdOrder(), np.concatenate([below[1:], above]), (above, below)),
        ComparedModel("large angles", "Eq. (31)", LargeAngle(neck, free=()), np.empty(0), None),
    )


def second_order(name: str, equation: str, abc: Sequence[float]) -> ComparedModel:
    """Return the model of Eq. (30) with a (1/s), b (1/s²) and c (1/s²)."""
    a, b, c = abc
    return ComparedModel(name, equation, Plant(), np.array([a, b, c]), (np.array([c]), np.array([1.0, a, b])))


def fitted_system(model: FittedModel) -> ComparedModel:
    """Return a model that ``anglecam identify`` has fitted.

    Raises
    ------
    ValueError
        If the model was fitted to free swings: it then has no input.
    """
    if not len(model.numerator):
        raise ValueError("the model was fitted to free swings: it has no input to step")
    kind: Model = Plant() if len(model.denominator) == 3 else ThirdOrder()
    parameters = np.concatenate([model.denominator[1:], model.numerator])
    return ComparedModel("fitted", model.name, kind, parameters, (model.numerator, model.denominator))


def side_by_side(systems: Sequence[ComparedModel], record: Record | None = None) -> SideBySide:
    """Simulate models with the command `SERIES`, or with the command of a measurement.

    Parameters
    ----------
    systems : sequence of ComparedModel
        To simulate; nothing is fitted.
    record : Record, optional
        With a command. Every model starts at rest at the measured initial angle. A zero of the angle that is not
        declared is chosen once for all models, such that the head rests at its first command; a wrong gain of a model
        then shows as an error.

    Returns
    -------
    SideBySide
        For the figure and the table.
    """
    if record is None or record.command is None:
        time = np.arange(0.0, float(SERIES.time[-1]) + 1.5, 0.005)
        return SideBySide(time, SERIES, tuple(systems), tuple(s.run(time, SERIES) for s in systems), None, {})
    change = record.command.first_change()
    still = record.time < (record.time[0] if change is None else change)
    start = float(record.angle[still].mean() if still.any() else record.angle[0])
    first = float(record.command.at(record.time[:1])[0])
    zero = 0.0 if record.zero_known else start - first
    angles = tuple(
        zero + s.model.predict(s.parameters, record.time, record.command, _at_rest(s, start - zero, first))
        for s in systems
    )
    rmse = {s.name: float(np.sqrt(np.mean((record.angle - a) ** 2))) for s, a in zip(systems, angles, strict=True)}
    return SideBySide(record.time, record.command, tuple(systems), angles, record.angle, rmse)


def _at_rest(system: ComparedModel, angle: float, command: float) -> Floats:
    """Return the state of rest at an angle, rad, with a command, rad; in the form of SYS2 also its two inner states."""
    state = np.zeros(system.model.states)
    state[0] = angle
    if isinstance(system.model, ThirdOrder):
        d2, d1, _, n2, n1, _ = system.parameters
        state[1:] = d2 * angle - n2 * command, d1 * angle - n1 * command
    return state


def driven_record(path: Path) -> Record | None:
    """Read a measured series and the command file next to it.

    Parameters
    ----------
    path : Path
        ``NAME.angles.csv``, with ``NAME.command.csv`` and ``rig.yaml`` in the same folder if they exist.

    Returns
    -------
    Record or None
        ``None`` if nothing was commanded.

    Raises
    ------
    AnglecamError
        If a file cannot be used.
    """
    command = command_beside(path)
    if command is None or command.first_change() is None:
        return None
    return record_from_series(read_series(path), command, zero_known=rig_beside(path).neutral != "auto")


def first_step(path: Path) -> tuple[Floats, Floats]:
    """Read a measured series without a command, from its first response if it has one.

    Returns
    -------
    time, angle : (n,) ndarray
        s from the start of that response, and rad from its initial angle, for the measured frames.

    Raises
    ------
    InputError
        If the file cannot be used.
    """
    series = read_series(path)
    found = responses(series.time, series.angle, series.sigma)
    start, zero = (found[0].start.value, found[0].from_angle.value) if found else (float(series.time[0]), 0.0)
    end = found[1].start.value if len(found) > 1 else np.inf
    used = series.ok & (series.time < end)
    return series.time[used] - start, series.angle[used] - zero
