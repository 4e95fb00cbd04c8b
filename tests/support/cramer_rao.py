"""The Cramér–Rao bound: no unbiased estimator of a model's parameters has a smaller covariance.

    cov ≥ σ² [(JᵀJ)⁻¹]_pp,   J = ∂(angles)/∂(parameters, nuisance parameters of every recording)

The nuisance parameters of a recording, its first state and perhaps its zero, are part of J because they are estimated
too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from anglecam.data.record import Record
from anglecam.identification.fit import Fit
from anglecam.identification.output_error import fit_output_error
from anglecam.models.model import Model

Floats = NDArray[np.float64]


def cramer_rao_bound(
    model: Model, parameters: Floats, records: Sequence[Record], nuisance: Sequence[Floats], sigma: float
) -> Floats:
    """Return the lower bound of the parameters' covariance for given commands, frame times and noise.

    Parameters
    ----------
    model : Model
        The plant.
    parameters : (p,) ndarray
        Its true parameters, SI.
    records : sequence of Record
        Their frame times and commands are used; their angles are not.
    nuisance : sequence of ndarray
        True nuisance parameters of each recording: initial states, then the zero (rad) unless declared.
    sigma : float
        Standard deviation of white noise on every angle, rad.

    Returns
    -------
    (p, p) ndarray
        SI.
    """
    exact = [
        replace(r, angle=model.predict(parameters, r.time, r.command, o[: model.states]) + o[model.states :].sum())
        for r, o in zip(records, nuisance, strict=True)
    ]
    # a fit that starts at the truth ends there and provides the derivatives
    return parameter_covariance(fit_output_error(model, exact, [parameters], nuisance=nuisance), sigma)


def parameter_covariance(fit: Fit, sigma: float) -> Floats:
    """Return the covariance of fitted parameters for noise of known size: the bound at the fit's result.

    Parameters
    ----------
    fit : Fit
        Fit with no parameter at one of its bounds.
    sigma : float
        Standard deviation of the noise, rad; `Fit.covariance` estimates it from the residuals.

    Returns
    -------
    (p, p) ndarray
        SI.
    """
    columns = fit.slopes.projected
    norm = np.linalg.norm(columns, axis=0)
    triangle = np.linalg.qr(columns / norm, mode="r")
    half = np.linalg.solve(triangle, np.eye(len(norm))) / norm[:, None]
    return sigma**2 * half @ half.T
