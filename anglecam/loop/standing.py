"""Which of the added effects stand, where structure remains that no effect explains.

A cause that is not in the ledger lends a part of its shape to one effect or another: the effect lowers the error, and
most of the error stays. An effect of the ledger that is present takes away nearly all of what it causes. So an effect
stands if the error that remains with it is a small share of the error without it, both by held-out prediction and
beyond the noise. The effects are judged from the one that lowers the error least, each with those that are left.
"""

from __future__ import annotations

import math

import numpy as np

from anglecam.effects import Effect
from anglecam.identification.fit import Fit
from anglecam.identification.noise import Noise
from anglecam.loop.cross_validation import Prediction, predict_held_out
from anglecam.loop.refit import effects_of, refit_without
from anglecam.loop.stepwise import Assessment, Task, assess
from anglecam.progress import Stage


def model_that_stands(task: Task, first: Assessment, last: Assessment) -> Assessment:
    """Remove the effects that leave most of the error which they were added to explain.

    Parameters
    ----------
    task : Task
        Recordings and policy.
    first : Assessment
        Of the base model.
    last : Assessment
        Of the final model, whose residual shows structure.

    Returns
    -------
    Assessment
        Of the model with the effects that stand; ``last`` if all of them do, ``first`` if none does, or if what is
        left of the model predicts worse than a constant angle.
    """
    now, noise = last, task.noise_within(last.fit)
    spread = float(np.std(np.concatenate([r.angle - r.angle.mean() for r in task.fitted])))
    while effects_of(now.fit):
        weakest, without = min(
            ((effect, _without(task, now.fit, effect)) for effect in effects_of(now.fit)),
            key=lambda pair: error_beyond_noise(pair[1], noise),
        )
        share = error_beyond_noise(now.held_out, noise) / max(error_beyond_noise(without, noise), 1e-300)
        if share <= task.policy.verdict.partly_explained_share:
            break
        task.progress(Stage(f"fitting without {weakest.id}"))
        fewer = refit_without(now.fit, weakest, task.fitted)
        if not effects_of(fewer) or not fewer.rmse < spread:
            return first
        now = assess(task, fewer)
    return now


def _without(task: Task, fit: Fit, effect: Effect) -> Prediction:
    held_out, _ = predict_held_out(refit_without(fit, effect, task.fitted), task.fitted, task.predicted, task.policy)
    return held_out


def error_beyond_noise(prediction: Prediction, noise: Noise | None) -> float:
    """Return the RMS error of a prediction beyond the noise, rad; all of it if the noise is unknown.

    The noise is taken at the lower limit of its interval: a rest in which something pushed the body would otherwise
    hide what remains.
    """
    sigma = noise.least_sigma if noise else 0.0
    return math.sqrt(max(prediction.rmse**2 - sigma**2, 0.0))
