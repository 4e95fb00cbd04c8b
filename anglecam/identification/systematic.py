"""What a measurement's systematic errors do to parameters: errors that no scatter shows, because they come again.

A pivot that is wrong by k lever arms turns the line to the mouth, against neutral's, by

    k·sin θ    or, where it is wrong across,    k·(1 − cos θ)

in every frame of its recording, a declared neutral that is off moves all angles of all recordings alike, and a command
dated wrongly all motion. A fit follows such an error as if the mechanism had moved so. JCGM 100:2008, 5.1.2, of
uncertainties of one origin.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from anglecam.data.record import Record
from anglecam.data.typing import Floats
from anglecam.identification.fit import Fit
from anglecam.identification.noise import Noise


def full_sigma(fit: Fit, records: Sequence[Record], noise: Noise) -> Floats:
    """Return the standard uncertainties, (p,) SI, of a fit's parameters: from scatter and `systematic_covariance`."""
    return np.sqrt(fit.sigma**2 + np.diag(systematic_covariance(fit, records, noise)))


def systematic_covariance(fit: Fit, records: Sequence[Record], noise: Noise) -> Floats:
    """Return what the uncertainty that a recording's angles have in common adds to the parameters' covariance.

    Parameters
    ----------
    fit : Fit
        To ``records``.
    records : sequence of Record
        With a stated uncertainty in every frame; without it nothing but the command's clock is added.
    noise : Noise
        What of the stated uncertainty is each frame's own, at most.

    Returns
    -------
    (p, p) ndarray
        SI; NaN for a parameter that its bound holds.
    """
    pulls = [fit.parameter_shift(records, _later(fit, records))] if any(r.clock_sigma for r in records) else []
    if all(np.isfinite(r.sigma).all() for r in records):
        pulls += _pulls_of_places(fit, records, noise)
    count = len(fit.parameters)
    return np.sum([np.outer(pull, pull) for pull in pulls], axis=0) if pulls else np.zeros((count, count))


def _later(fit: Fit, records: Sequence[Record]) -> list[Floats]:
    """Return what the angles would err by if all commands came later by their clock's uncertainty, rad."""
    predicted = [r.angle - left for r, left in zip(records, fit.residuals, strict=True)]
    return [r.clock_sigma * np.gradient(angle, r.time) for r, angle in zip(records, predicted, strict=True)]


def _pulls_of_places(fit: Fit, records: Sequence[Record], noise: Noise) -> list[Floats]:
    """Return what a neutral and pivots that are wrong by their uncertainties change each parameter by, SI."""
    stated = np.concatenate([r.sigma for r in records])
    own = min(noise.sigma, fit.rmse)  # what is each frame's own scatters about the model
    shared = np.sqrt(max(0.0, float(np.mean(stated**2)) - own**2))
    pulls = [shared * fit.parameter_shift(records, [np.ones(len(r.time)) for r in records])]
    for name in dict.fromkeys(r.name for r in records):
        wrong = _wrong_pivot([r for r in records if r.name == name])
        for course in (np.sin, lambda angle: 1.0 - np.cos(angle)):
            errors = [wrong * course(r.angle) if r.name == name else np.zeros(len(r.time)) for r in records]
            pulls.append(fit.parameter_shift(records, errors))
    return pulls


def _wrong_pivot(records: Sequence[Record]) -> float:
    """Return the pivot's standard uncertainty, in lever arms, by which stated uncertainty grows away from neutral."""
    sigma, angle = (np.concatenate(each) for each in ([r.sigma for r in records], [r.angle for r in records]))
    turned = float(np.sum(2.0 - 2.0 * np.cos(angle)))
    return float(np.sqrt(np.sum(sigma**2 - sigma.min() ** 2) / turned)) if turned > 0.0 else 0.0
