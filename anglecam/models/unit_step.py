"""Rise, overshoot and settling of a model's step response, as MATLAB's ``stepinfo`` defines them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from anglecam.data.command import Command
from anglecam.data.step_figures import HIGH, LOW, NO_STEP, StepFigures, first_crossing, settling
from anglecam.data.typing import Floats
from anglecam.models.model import Model

MOST_STIFF = 1e6
"""Ratio of the fastest pole to the slowest beyond which no response is simulated: the integrator's steps are no longer
than the fastest time constant."""


def step_figures(model: Model, parameters: Floats, poles: NDArray, steady_state: float) -> StepFigures:
    """Simulate the response to a unit step and return its figures.

    Parameters
    ----------
    model : Plant or ThirdOrder
        The model.
    parameters : (p,) ndarray
        Its parameters, SI.
    poles : ndarray of complex
        Its poles, 1/s; the slowest sets the simulated time.
    steady_state : float
        Gain at rest; times and overshoot refer to it.

    Returns
    -------
    StepFigures
        `NO_STEP` for a model that is unstable, has no steady state or takes too long to reach it.
    """
    slowest = -float(np.max(poles.real))
    if slowest * MOST_STIFF <= float(np.max(np.abs(poles))) or steady_state == 0.0:
        return NO_STEP
    time = np.linspace(0.0, 12.0 / slowest, 6001)
    step = Command(np.zeros(1), np.ones(1))
    response = model.predict(parameters, time, step, np.zeros(model.states)) / steady_state

    rise = first_crossing(time, response, HIGH) - first_crossing(time, response, LOW)
    overshoot = max(0.0, float(response.max()) - 1.0)
    return StepFigures(rise, overshoot, settling(time, response), steady_state)
