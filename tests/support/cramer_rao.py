"""The Cramér–Rao bound: no unbiased estimator of a model's parameters has a smaller covariance.

    cov ≥ σ² [(JᵀJ)⁻¹]_pp,   J = ∂(angles)/∂(parameters, every recording's own unknowns)

The unknowns of a recording, its first state and perhaps its zero, are in J because they have to be estimated too.
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
    model: Model, parameters: Floats, records: Sequence[Record], own: Sequence[Floats], sigma: float
) -> Floats:
    """Bound the covariance of a model's parameters for given commands, frame times and noise.

    Parameters
    ----------
    model : Model
        The plant.
    parameters : (p,) ndarray
        Its true parameters, SI.
    records : sequence of Record
        For their frame times and commands; their angles are not used.
    own : sequence of ndarray
        Each recording's true unknowns: initial states, then the zero (rad) unless declared.
    sigma : float
        Standard deviation of white noise on every angle, rad.

    Returns
    -------
    (p, p) ndarray
        SI.
    """
    exact = [
        replace(r, angle=model.predict(parameters, r.time, r.command, o[: model.states]) + o[model.states :].sum())
        for r, o in zip(records, own, strict=True)
    ]
    # a fit that begins at the truth ends there, and leaves its derivatives
    return parameter_covariance(fit_output_error(model, exact, [parameters], nuisance=own), sigma)


def parameter_covariance(fit: Fit, sigma: float) -> Floats:
    """Return the covariance of fitted parameters under noise of known size: the bound where the fit ended.

    Parameters
    ----------
    fit : Fit
        With no parameter at a bound of its own.
    sigma : float
        Standard deviation of the noise, rad; `Fit.covariance` takes what the residual shows.

    Returns
    -------
    (p, p) ndarray
        SI.
    """
    unknowns = fit.jacobian.shape[1]
    norm = np.linalg.norm(fit.jacobian, axis=0)
    triangle = np.linalg.qr(fit.jacobian / norm, mode="r")
    half = np.linalg.solve(triangle, np.eye(unknowns)) / norm[:, None]
    p = len(fit.parameters)
    return sigma**2 * (half @ half.T)[:p, :p]
