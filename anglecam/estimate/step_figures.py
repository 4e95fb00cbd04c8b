"""Rise, overshoot and settling of a model's step response, as MATLAB's ``stepinfo`` defines them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anglecam.estimate.output_error import Model
from anglecam.session import Command

Floats = NDArray[np.float64]

SETTLED = 0.02
"""Share of the whole way within which a response counts as settled."""


@dataclass(frozen=True)
class StepFigures:
    """Figures of a step response; NaN where the model has no steady state."""

    rise_time: float
    """From 10 % to 90 % of the way, s."""
    overshoot: float
    """Peak beyond the steady state as a share of it, not below 0."""
    settling_time: float
    """After which the response stays within `SETTLED` of the steady state, s."""
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

    def first_crossing(level: float) -> float:
        i = int(np.argmax(response >= level))
        if i == 0:
            return float(time[0]) if response[0] >= level else np.nan
        return float(np.interp(level, response[i - 1 : i + 1], time[i - 1 : i + 1]))

    outside = np.flatnonzero(np.abs(response - 1.0) > SETTLED)
    last = int(outside[-1]) if len(outside) else 0
    settled = time[last]
    if last + 1 < len(time):
        edge = np.abs(response[last : last + 2] - 1.0)
        settled = time[last] + (time[last + 1] - time[last]) * (edge[0] - SETTLED) / (edge[0] - edge[1])
    return StepFigures(
        first_crossing(0.9) - first_crossing(0.1), max(0.0, float(response.max()) - 1.0), float(settled), steady_state
    )
