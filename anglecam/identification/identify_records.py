"""From recordings to an identified model, with any estimator of the registry."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from anglecam.data.record import Record
from anglecam.data.step_figures import NO_STEP
from anglecam.data.typing import Floats
from anglecam.errors import RigError
from anglecam.identification.estimators import ESTIMATORS
from anglecam.identification.identified import Identified
from anglecam.identification.initial_guess import start_parameters
from anglecam.identification.noise import noise_floor
from anglecam.identification.output_error import fit_output_error, predict_output_error
from anglecam.identification.systematic import systematic_covariance
from anglecam.io.rig import Rig
from anglecam.models.plant import Plant
from anglecam.neck.large_angle import LargeAngleNeck


def identify_records(
    fitted: Sequence[Record],
    rig: Rig,
    estimator: str,
    *,
    held_out: Sequence[Record] = (),
    neck: LargeAngleNeck | None = None,
) -> Identified:
    """Fit a model to recordings of one rig.

    Parameters
    ----------
    fitted : sequence of Record
        With or without commands; the initial states of each are unknown.
    rig : Rig
        Source of the model's starting values, where they are declared.
    estimator : str
        A key of `anglecam.identification.estimators.ESTIMATORS`: ``ekf``, the paper's extended Kalman filter (SYS1);
        ``oe2``, output error of second order; ``oe3``, output error of third order with zeros (SYS2, Eq. (36));
        ``neck``, output error of the neck at large angles, Eq. (31), in physical parameters.
    held_out : sequence of Record
        Recordings to predict only.
    neck : LargeAngleNeck, optional
        What is known of the neck, for an estimator that takes one; the paper's neck otherwise.

    Returns
    -------
    Identified
        The model.

    Raises
    ------
    RigError
        If there is no such estimator, it takes no neck though one is given, no recording is left to fit, or the
        declared neck cannot make the recorded motion.

    Examples
    --------
    A free swing of θ̈ + 2·θ̇ + 50·θ = 0, without noise:

    >>> import numpy as np
    >>> time = np.arange(0.0, 3.0, 0.05)
    >>> angle = 0.2 * np.exp(-time) * np.cos(7.0 * time)
    >>> swing = Record("swing", time, angle, command=None, zero_known=True, sigma=np.full(len(time), 1e-3))
    >>> model = identify_records([swing], Rig(), "oe2")
    >>> model.names
    ('a_per_s', 'b_per_s2')
    >>> [round(float(value), 3) for value in model.values]
    [2.0, 50.0]
    """
    if estimator not in ESTIMATORS:
        raise RigError(f"no estimator {estimator!r}; choose one of {', '.join(ESTIMATORS)}")
    chosen = ESTIMATORS[estimator]
    if neck is not None and not chosen.takes_neck:
        raise RigError(f"estimator {estimator!r} takes no neck")
    if not fitted:
        raise RigError(
            "every recording that can be used is held out; nothing is left to fit"
            if held_out
            else "no recording that can be used; nothing to fit"
        )
    driven = any(r.command is not None for r in fitted)
    starts = start_parameters(fitted)
    if {"a", "b", "c"} & rig.model.model_fields_set:
        declared = [key in rig.model.model_fields_set for key in "abc"]
        starts.insert(0, np.where(declared, declared_start(rig), [*starts[0], 0.0][:3])[: len(starts[0])])
    second_order = fit_output_error(Plant(driven=driven), fitted, starts)
    estimate = chosen.fit(second_order, fitted, starts[0], neck)
    covariance = estimate.covariance
    if noise := noise_floor(fitted):
        covariance = covariance + systematic_covariance(estimate.optimum, fitted, noise)
    run = estimate.free_run
    scale = run.model.to_file
    return Identified(
        estimator,
        run.model.names,
        estimate.parameters * scale,
        covariance * np.outer(scale, scale),
        run,
        predict_output_error(run, held_out) if held_out else None,
        chosen.step_response(run) if driven else NO_STEP,
        tuple(fitted),
        estimate.settled,
    )


def declared_start(rig: Rig) -> Floats:
    """Return the rig's starting values a (1/s), b (1/s²), c (1/s²)."""
    return np.array([rig.model.a, rig.model.b, rig.model.c])
