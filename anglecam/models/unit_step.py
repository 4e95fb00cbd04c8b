"""Rise, overshoot and settling of a model's step response, as MATLAB's ``stepinfo`` defines them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anglecam.data.step_figures import HIGH, LOW, first_crossing, settling
from anglecam.identification.fit import Model
from anglecam.io.session import Command

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class StepFigures:
    """Figures of a step response; NaN where the model has no steady state."""

    rise_time: float
    """From 10 % to 90 % of the way, s."""
    overshoot: float
    """Peak beyond the steady state as a share of it, not below 0."""
    settling_time: float
    """After which the response stays within 2 % of the steady state, s."""
    steady_state: float
    """Per unit of the command."""


NO_STEP = StepFigures(np.nan, np.nan, np.nan, np.nan)


def step_figures(model: Model, parameters: Floats, poles: NDArray, steady_state: float) -> StepFigures:
    """Simulate the response to a unit step and read its figures off.

    Parameters
    ----------
    model : Plant or ThirdOrder
        What responds.
    parameters : (p,) ndarray
        Its parameters, SI.
    poles : ndarray of complex
        Its poles, 1/s: how long and how finely to simulate.
    steady_state : float
        Gain at rest, to which times and overshoot refer.

    Returns
    -------
    StepFigures
        `NO_STEP` for a model that is not stable.
    """
    slowest = -float(np.max(poles.real))
    if slowest <= 0.0 or steady_state == 0.0:
        return NO_STEP
    time = np.linspace(0.0, 12.0 / slowest, 6001)
    step = Command(np.zeros(1), np.ones(1))
    response = model.predict(parameters, time, step, np.zeros(model.states)) / steady_state

    rise = first_crossing(time, response, HIGH) - first_crossing(time, response, LOW)
    overshoot = max(0.0, float(response.max()) - 1.0)
    return StepFigures(rise, overshoot, settling(time, response), steady_state)
