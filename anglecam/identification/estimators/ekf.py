"""The paper's extended Kalman filter, iterated, on the second-order model (SYS1)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from anglecam.data.record import Record
from anglecam.data.typing import Floats
from anglecam.identification.estimators.estimator import Estimate, Estimator
from anglecam.identification.estimators.oe2 import second_order_step

if TYPE_CHECKING:
    from anglecam.identification.fit import Fit
    from anglecam.neck.large_angle import LargeAngleNeck


def _fit(second_order: Fit, records: Sequence[Record], start: Floats, neck: LargeAngleNeck | None) -> Estimate:
    from anglecam.identification.ekf import fit_ekf, settings_for
    from anglecam.identification.noise import noise_floor
    from anglecam.identification.output_error import fit_output_error
    from anglecam.models.plant import Plant

    noise = noise_floor(records)
    sigma = max(noise.sigma if noise else 0.0, second_order.rmse)
    initial = np.clip(start if len(start) == 3 else np.append(start, 0.0), Plant().lower, Plant().upper)
    estimate = fit_ekf(records, initial, settings_for(records, initial, sigma))
    n = len(second_order.parameters)
    parameters, covariance = estimate.parameters[:n], estimate.covariance[:n, :n]
    if not estimate.settled:
        covariance = np.full((n, n), np.nan)
    free_run = fit_output_error(second_order.model, records, [parameters], nuisance=second_order.nuisance, fixed=True)
    return Estimate(free_run, parameters, covariance, second_order, estimate.settled)


ESTIMATOR = Estimator(
    id="ekf",
    summary="the paper's extended Kalman filter, iterated, on the second-order model",
    fit=_fit,
    step_response=second_order_step,
)
