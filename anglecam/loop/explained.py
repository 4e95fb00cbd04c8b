"""How much each named effect explains, and why no further one is named."""

from __future__ import annotations

import math

import numpy as np

from anglecam.loop.cross_validation import Prediction, predict_held_out
from anglecam.loop.refit import effects_of, refit_without
from anglecam.loop.stepwise import Assessment, Task


def shares_explained(task: Task, last: Assessment, before: Prediction, noise_sigma: float) -> list[float]:
    """Return the share of the prediction error beyond the noise, in squares, that each effect takes away.

    Parameters
    ----------
    task : Task
        What the search worked on.
    last : Assessment
        Of the final model.
    before : Prediction
        Of the same frames as ``last.held_out``, by the base model.
    noise_sigma : float
        Standard deviation of the noise, rad; 0 if it is unknown.

    Returns
    -------
    list of float
        In the order in which the effects were added; each beside those before it.
    """
    fewer, shares = last.fit, [whole_share(before, last.held_out, noise_sigma)]
    for effect in reversed(effects_of(last.fit)[1:]):
        fewer = refit_without(fewer, effect, task.fitted)
        held_out, _ = predict_held_out(fewer, task.fitted, task.predicted, task.policy)
        shares.append(whole_share(before, held_out, noise_sigma))
    return np.diff([0.0, *reversed(shares)]).tolist()


def whole_share(before: Prediction, after: Prediction, noise_sigma: float) -> float:
    """Return the share of the squared error beyond the noise that a model takes away; NaN if there is none beyond."""
    excess = before.rmse**2 - noise_sigma**2
    return (before.rmse**2 - after.rmse**2) / excess if excess > 0.0 else math.nan


def why_stopped(task: Task, last: Assessment, *, remains: bool) -> str:
    """Return a sentence that says why the model has no further effect."""
    test = last.residual_test
    if not remains and test.passed:
        return f"what remains cannot be told from noise (p = {test.p_value:.2g})"
    if not remains:
        return "what remains is smaller than errors of the measurement or of the models can be"
    if len(effects_of(last.fit)) == task.policy.stepwise.most_effects:
        return f"no more than {task.policy.stepwise.most_effects} effects are added"
    return "with no further effect are frames predicted better, beyond chance, that it was not fitted to"
