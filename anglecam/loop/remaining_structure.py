"""Whether the final model leaves structure that no effect explains, and whether it contradicts the recordings."""

from __future__ import annotations

import numpy as np

from anglecam.identification.fit import Fit
from anglecam.identification.output_error import predict_output_error
from anglecam.loop.cross_validation import robust_sigma
from anglecam.loop.fit_effect import fit_to_more
from anglecam.loop.policy import Policy
from anglecam.loop.refit import plant_of
from anglecam.loop.stepwise import Assessment, Task, smallest_structure


def structure_remains(task: Task, first: Assessment, last: Assessment) -> bool:
    """Return whether the final model leaves structure that no candidate explains.

    Parameters
    ----------
    task : Task
        What the search worked on.
    first, last : Assessment
        Of the base model and of the final one.

    Returns
    -------
    bool
        Whether the verdict is ``unexplained``, or ``partly_explained`` if the model has an effect.
    """
    least = smallest_structure(task, first)
    negligible = last.fit.rmse**2 <= task.camera**2 + least**2
    return is_wrong(task, last, least) or not (last.residual_test.passed or negligible)


def is_wrong(task: Task, last: Assessment, least: float) -> bool:
    """Return whether a model contradicts the recordings that it was not fitted to, or physics.

    Parameters
    ----------
    task : Task
        What the search worked on.
    last : Assessment
        Of the model.
    least : float
        RMS, rad, below which structure is not searched.

    Returns
    -------
    bool
        Whether what it predicts is too far off, or its body gains energy that nothing gives it.
    """
    return _contradicted(task, last, least) or gains_energy(last.fit, task.policy)


def _contradicted(task: Task, last: Assessment, least: float) -> bool:
    """Return whether the held-out recordings differ from every prediction with parameters that fit the others as well.

    The robust error is used, because a few frames are no contradiction: the instant at which dry friction lets a body
    break away is all or nothing, and may be predicted wrongly once.
    """
    most = task.policy.verdict.contradiction_ratio * max(last.fit.rmse, least)
    if last.held_out.robust_sigma <= most or not task.predicted:
        return last.held_out.robust_sigma > most
    predicted = predict_output_error(last.fit, task.predicted)
    nuisance, both = [*last.fit.nuisance, *predicted.nuisance], [*task.fitted, *task.predicted]
    fit = fit_to_more(last.fit, both, nuisance, task.ledger, task.policy)
    return robust_sigma(fit.residuals[len(task.fitted) :]) > most


def gains_energy(fit: Fit, policy: Policy) -> bool:
    """Return whether a body without a command would gain energy: something that the model lacks drives it."""
    damping, sigma = float(fit.parameters[0]), float(np.nan_to_num(fit.sigma[0]))
    return not plant_of(fit).driven and damping < -policy.verdict.energy_gain_sigmas * sigma
