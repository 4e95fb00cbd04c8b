"""Whether recordings determine the size of an effect.

The standard uncertainty of a size is that of the linearised model. Where it is small the size is determined. Where it
is as large as the size, shape and size may only be correlated, so the profile likelihood decides: the size is set much
larger and the other parameters are fitted again. If the recordings fit as well, the size has no upper limit, and the
effect stands for another one that has the shape of its limit. Raue et al., Bioinformatics 25, 2009, 1923-1929.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy import special

from anglecam.data.record import Record
from anglecam.effects import Effect
from anglecam.identification.fit import Fit
from anglecam.identification.output_error import fit_output_error
from anglecam.loop.likelihood import log_likelihood_gain
from anglecam.loop.policy import DEFAULT, Policy
from anglecam.loop.refit import effects_of, plant_of

FARTHER = 10.0
"""Multiple of a size at which the profile likelihood is evaluated."""


def sizes_determined(fit: Fit, records: Sequence[Record], policy: Policy = DEFAULT) -> bool:
    """Return whether the recordings determine the size of every effect of a fitted plant.

    Parameters
    ----------
    fit : Fit
        Of a `Plant` with effects.
    records : sequence of Record
        The fitted recordings.
    policy : Policy
        Thresholds.

    Returns
    -------
    bool
        False if a size is at a bound, changes no prediction or has no upper limit; the stiffness of a stop needs
        none.
    """
    return all(_determined(fit, effect, records, policy) for effect in effects_of(fit))


def _determined(fit: Fit, effect: Effect, records: Sequence[Record], policy: Policy) -> bool:
    first = effect.parameters[0]
    place = fit.model.names.index(first.name)
    size, sigma = fit.parameters[place] - first.null, fit.sigma[place]
    if first.unlimited:
        return bool(size != 0.0)
    if not np.isfinite(sigma):
        return False
    if abs(size) > policy.candidates.linear_size_sigmas * sigma:
        return True
    farther = float(np.clip(first.null + FARTHER * size, first.lower, first.upper))
    fixed = effect.with_fixed({first.name: farther})
    effects = tuple(fixed if e is effect else e for e in effects_of(fit))
    plant = replace(plant_of(fit), effects=effects)
    start = np.delete(fit.parameters, place)
    profile = fit_output_error(plant, records, [start], nuisance=fit.nuisance, phi=fit.phi)
    loss = log_likelihood_gain(profile.cost, fit.cost, len(fit.white))
    return 2.0 * loss > special.chdtri(1, policy.candidates.false_size_limit_rate)
