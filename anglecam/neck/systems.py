"""The paper's models side by side, as in Figs. 10, 11, 14 and 15: SYS1, SYS2, Eqs. (28) and (31), and fitted ones.

Command and angle are both of the head. Eqs. (28) and (31) take the command through C_i of Eq. (29). SYS2's input has no
unit: a step of height 1 is the one step that the paper commanded, after which the head rested at 22°, so that here its
command of 22° is taken for 1 and the model comes to rest at 23.58°.

The paper prints neither its measured curves nor the levels of the step series of Figs. 11 and 15; those of `SERIES` are
ours: several heights, each from where the one before it ended, within what its links reach.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anglecam.estimate.output_error import Model, fit_output_error
from anglecam.estimate.record import Record
from anglecam.estimate.step_figures import StepFigures
from anglecam.export import FittedModel
from anglecam.neck.large_angle import LargeAngleNeck, acceleration, equilibrium, linearise
from anglecam.neck.linear import linear_neck
from anglecam.neck.pd import PdGains, simulate_pd, sys2
from anglecam.neck.step import linear_step_figures
from anglecam.session import Command
from anglecam.simulate.large_angle import LargeAngle
from anglecam.simulate.plant import Plant
from anglecam.simulate.third_order import ThirdOrder

Floats = NDArray[np.float64]

SYS1 = (25.9786, 523.7292, 507.5597)
"""a (1/s), b (1/s²) and c (1/s²) that the paper identified."""
STEP = np.radians(22.0)
"""The step of Figs. 10 and 14, rad."""
SERIES = Command(
    np.array([0.0, 0.5, *(0.5 + 1.5 * np.arange(1, 9))]),
    np.radians([0.0, 22.0, 0.0, 12.0, -8.0, 18.0, 5.0, -15.0, 10.0, 0.0]),
)
"""A command in the manner of Figs. 11 and 15."""
_TIME_CONSTANTS = 14.0
"""For which a neck at large angles is simulated until it rests."""


@dataclass(frozen=True)
class System:
    """A model of the neck from command to angle."""

    name: str
    equation: str
    """Where it stands in the paper, or what fitted it."""
    model: Model
    parameters: Floats
    """(p,) SI, in the order of ``model.names``."""
    transfer: tuple[Floats, Floats] | None
    """Numerator and denominator; ``None`` where it is not linear."""

    def run(self, time: Floats, command: Command) -> Floats:
        """Run it from rest at neutral.

        Parameters
        ----------
        time : (n,) ndarray
            Instants, s, not before the command begins.
        command : Command
            Of the head, rad.

        Returns
        -------
        (n,) ndarray
            Angle, rad; NaN from where the head leaves what it can reach.
        """
        return self.model.predict(self.parameters, time, command, np.zeros(self.model.states))

    def figures(self, height: float = STEP) -> StepFigures:
        """Return rise, overshoot, settling and, per command, steady state of a step of a height, rad.

        All NaN where it does not come to rest.
        """
        if self.transfer is not None:
            return linear_step_figures(*self.transfer)
        assert isinstance(self.model, LargeAngle)
        neck = self.model.neck_at(self.parameters)
        voltage = neck.parameters.servo.command_gain * height
        near = linearise(neck, equilibrium(neck, voltage))
        slowest = -float(np.roots([1.0, near.a, near.b]).real.max())
        motion = simulate_pd(
            lambda delta, omega, u: float(acceleration(neck, delta, omega, u)),
            PdGains(),
            voltage,
            _TIME_CONSTANTS / slowest,
        )
        told = motion.figures
        return StepFigures(told.rise_time, told.overshoot, told.settling_time, float(told.steady_state / height))

    def predict(self, record: Record) -> tuple[Floats, float]:
        """Run it beside a measurement, from a fitted first state.

        Parameters
        ----------
        record : Record
            With a command; the model is held, only the first state and the zero are the recording's own.

        Returns
        -------
        angle : (n,) ndarray
            rad.
        rmse : float
            Of measured minus predicted, rad.
        """
        run = fit_output_error(self.model, [record], [self.parameters], fixed=True)
        return record.angle - run.residuals[0], run.rmse


def paper_systems(neck: LargeAngleNeck) -> tuple[System, ...]:
    """Return SYS1, the neck by Eq. (28), SYS2 and the neck by Eq. (31).

    Parameters
    ----------
    neck : LargeAngleNeck
        Of Eqs. (28) and (31).

    Returns
    -------
    tuple of System
        In that order.
    """
    linear = linear_neck(neck.parameters)
    gain = linear.c * neck.parameters.servo.command_gain
    third = sys2()
    above, below = third.num[0][0] / np.degrees(STEP), third.den[0][0]
    return (
        second_order("SYS1", "Eq. (30), identified", SYS1),
        second_order("small angles", "Eq. (28)", (linear.a, linear.b, gain)),
        System("SYS2", "Eq. (36)", ThirdOrder(), np.concatenate([below[1:], above]), (above, below)),
        System("large angles", "Eq. (31)", LargeAngle(neck, free=()), np.empty(0), None),
    )


def second_order(name: str, equation: str, abc: Sequence[float]) -> System:
    """Return a system of Eq. (30) from a (1/s), b (1/s²) and c (1/s²)."""
    a, b, c = abc
    return System(name, equation, Plant(), np.array([a, b, c]), (np.array([c]), np.array([1.0, a, b])))


def fitted_system(model: FittedModel) -> System:
    """Return the system of a model that ``anglecam identify`` has fitted.

    Raises
    ------
    ValueError
        Where nothing was commanded, so that nothing is known of the input.
    """
    if not len(model.numerator):
        raise ValueError("the model was fitted to free swings: it has no input to step")
    kind: Model = Plant() if len(model.denominator) == 3 else ThirdOrder()
    return System("fitted", model.name, kind, model.values, (model.numerator, model.denominator))
