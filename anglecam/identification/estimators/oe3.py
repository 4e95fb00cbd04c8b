"""Output error of the third-order model with two zeros (SYS2), Eq. (36)."""

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

POLE_STARTS = (0.5, 1.0, 3.0)
"""Starts of the third pole, as multiples of the second-order model's natural frequency."""


def _fit(second_order: Fit, records: Sequence[Record], start: Floats, neck: LargeAngleNeck | None) -> Estimate:
    """Start from the second-order model times (s + p)/(s + p) for several p; the fit then separates pole and zero."""
    from anglecam.identification.output_error import fit_output_error
    from anglecam.models.third_order import ThirdOrder

    a, b, *c = second_order.parameters
    natural = np.sqrt(abs(b))
    starts = [
        np.array([a + p, b + a * p, b * p] + [n for gain in c for n in (0.0, gain, gain * p)])
        for p in (factor * natural for factor in POLE_STARTS)
    ]
    return optimum_estimate(fit_output_error(ThirdOrder(driven=bool(c)), records, starts), records)


def _step_response(fit: Fit) -> StepFigures:
    from anglecam.models.unit_step import step_figures

    p = fit.parameters
    return step_figures(fit.model, p, np.roots([1.0, *p[:3]]), p[5] / p[2] if p[2] else 0.0)


ESTIMATOR = Estimator(
    id="oe3",
    summary="output error of the third-order model with two zeros",
    fit=_fit,
    step_response=_step_response,
)
