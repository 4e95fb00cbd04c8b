"""Fits the models that a search on stretches found to the whole recordings, for the errors and sizes that are stated.

The verdict remains that of the search, unless the whole recordings contradict the final model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from anglecam.data.record import Record
from anglecam.identification.fit import Fit
from anglecam.identification.output_error import fit_output_error, predict_output_error
from anglecam.loop.cross_validation import Prediction, compare, predict_held_out
from anglecam.loop.policy import Policy
from anglecam.loop.verdict import Verdict

CONTRADICTED = {"attributed": "partly_explained", "nothing_missing": "unexplained"}
"""Verdict of the search → verdict if the whole recordings contradict its model."""


def with_whole_recordings(
    verdict: Verdict, fitted: Sequence[Record], predicted: Sequence[Record], rng: np.random.Generator
) -> Verdict:
    """Fit base and final model of a verdict to whole recordings.

    Parameters
    ----------
    verdict : Verdict
        From a search on stretches.
    fitted, predicted : sequence of Record
        The whole recordings, or windows of them where a free run diverges; ``predicted`` may be empty.
    rng : numpy.random.Generator
        For the bootstrap interval of the gain.

    Returns
    -------
    Verdict
        With the errors and parameters of the whole recordings.
    """
    policy = verdict.policy
    before, after = (
        fit_output_error(fit.model, fitted, [fit.parameters], phi=fit.phi) for fit in (verdict.before, verdict.after)
    )
    before_held_out, after_held_out = (_predict(fit, fitted, predicted, policy) for fit in (before, after))
    most = policy.verdict.contradiction_ratio * max(verdict.after.rmse, policy.stepwise.numerical_error_rad)
    contradicted = not (after.rmse <= most and after_held_out.robust_sigma <= most)  # a run may end in no number
    return replace(
        verdict,
        verdict=CONTRADICTED.get(verdict.verdict, verdict.verdict) if contradicted else verdict.verdict,
        before=before,
        after=after,
        before_held_out=before_held_out,
        after_held_out=after_held_out,
        gain=compare(before_held_out, after_held_out, rng, policy),
        fitted=tuple(fitted),
        held_out=tuple(predicted),
    )


def _predict(fit: Fit, fitted: Sequence[Record], predicted: Sequence[Record], policy: Policy) -> Prediction:
    """Predict the held-out recordings, or every frame by cross-validation if there are none."""
    if not predicted:
        return predict_held_out(fit, fitted, (), policy)[0]
    found = predict_output_error(fit, predicted)
    return Prediction(tuple(predicted), found.residuals, found.cost, fit.phi)
