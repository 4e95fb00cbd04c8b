"""Which of the added effects are named, where structure remains that no effect explains.

A cause that is not in the ledger lends a part of its shape to one effect or another. So the effects are named together
if they explain the larger part of what the base model misses: the main cause is then among them. An effect without
which the held-out frames are predicted no worse is left out.
"""

from __future__ import annotations

from anglecam.identification.fit import Fit
from anglecam.loop.cross_validation import Prediction, predict_held_out
from anglecam.loop.explained import whole_share
from anglecam.loop.refit import effects_of, refit_without
from anglecam.loop.stepwise import Assessment, Task, assess
from anglecam.progress import Stage


def model_that_stands(task: Task, first: Assessment, last: Assessment, before: Prediction) -> Assessment:
    """Return the final model without effects that predict nothing, or the base model.

    Parameters
    ----------
    task : Task
        Recordings and policy.
    first : Assessment
        Of the base model.
    last : Assessment
        Of the final model, whose residual shows structure.
    before : Prediction
        Of the same frames as ``last.held_out``, by the base model.

    Returns
    -------
    Assessment
        Of the model with the effects that are named; ``first`` if they explain the smaller part.
    """
    now = last
    while effects_of(now.fit):
        without = {one.id: refit_without(now.fit, one, task.fitted) for one in effects_of(now.fit)}
        errors = {name: _held_out(task, fit).rmse for name, fit in without.items()}
        needless = min(errors, key=lambda name: errors[name])
        if errors[needless] > now.held_out.rmse:
            break
        task.progress(Stage(f"leaving out {needless}"))
        now = assess(task, without[needless])
    noise = task.noise_within(now.fit)
    # at its lower limit: a rest in which something pushed the body would otherwise hide what remains
    explained = whole_share(before, now.held_out, noise.least_sigma if noise else 0.0)
    return now if explained >= task.policy.verdict.least_explained_share else first


def _held_out(task: Task, fit: Fit) -> Prediction:
    return predict_held_out(fit, task.fitted, task.predicted, task.policy)[0]
