"""Output error of the second-order model θ̈ = c·u − a·θ̇ − b·θ, Eq. (30)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from anglecam.data.record import Record
from anglecam.data.step_figures import StepFigures
from anglecam.data.typing import Floats
from anglecam.identification.estimators.estimator import Estimate, Estimator, optimum_estimate

if TYPE_CHECKING:
    from anglecam.identification.fit import Fit
    from anglecam.neck.large_angle import LargeAngleNeck


def _fit(second_order: Fit, records: Sequence[Record], start: Floats, neck: LargeAngleNeck | None) -> Estimate:
    return optimum_estimate(second_order, records)


def second_order_step(fit: Fit) -> StepFigures:
    """Return the figures of a second-order model's step response."""
    from anglecam.models.unit_step import step_figures

    p = fit.parameters
    return step_figures(fit.model, p, np.roots([1.0, p[0], p[1]]), p[2] / p[1] if p[1] else 0.0)


ESTIMATOR = Estimator(
    id="oe2",
    summary="output error of the second-order model",
    fit=_fit,
    step_response=second_order_step,
)
