"""Output error of the neck at large angles, Eq. (31), in physical parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from anglecam.data.record import Record
from anglecam.data.step_figures import StepFigures
from anglecam.data.typing import Floats
from anglecam.errors import RigError
from anglecam.identification.estimators.estimator import Estimate, Estimator, optimum_estimate

if TYPE_CHECKING:
    from anglecam.identification.fit import Fit
    from anglecam.neck.large_angle import LargeAngleNeck


def _fit(second_order: Fit, records: Sequence[Record], start: Floats, neck: LargeAngleNeck | None) -> Estimate:
    from anglecam.identification.output_error import fit_output_error
    from anglecam.models.large_angle import DEFAULT, FREE_SWING, LargeAngle
    from anglecam.neck.large_angle import LargeAngleNeck

    driven = len(second_order.parameters) == 3
    model = LargeAngle(neck or LargeAngleNeck(), DEFAULT if driven else FREE_SWING)
    starts = model.starts(second_order.parameters) if driven else [model.nominal]
    fit = fit_output_error(model, records, starts)
    if not np.isfinite(fit.cost):
        raise RigError(
            "the neck as it is declared cannot move as it did: from every start it leaves the reach of its linkage;"
            " check linkage_slope and spring.common_stretch_m in the neck file"
        )
    return optimum_estimate(fit, records)


def _step_response(fit: Fit) -> StepFigures:
    """Return the figures of the model linearised at neutral: a unit step (1 rad) is beyond the linkage's reach."""
    from anglecam.models.large_angle import LargeAngle
    from anglecam.models.plant import Plant
    from anglecam.models.unit_step import step_figures
    from anglecam.neck.large_angle import linearise

    assert isinstance(fit.model, LargeAngle)
    neck = fit.model.neck_at(fit.parameters)
    near = linearise(neck)
    p = np.array([near.a, near.b, near.c * neck.parameters.servo.command_gain])
    return step_figures(Plant(), p, np.roots([1.0, near.a, near.b]), p[2] / p[1])


ESTIMATOR = Estimator(
    id="neck",
    summary="output error of the neck at large angles, in physical parameters",
    fit=_fit,
    step_response=_step_response,
    takes_neck=True,
)
