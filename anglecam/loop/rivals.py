"""The effects that could have produced the recordings as well as another one: its alias set."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain

import numpy as np
from scipy import special

from anglecam.data.record import Record
from anglecam.effects import Effect
from anglecam.effects.seen import Motion, usual_range
from anglecam.identification.fit import Fit
from anglecam.loop.fit_effect import fit_with
from anglecam.loop.likelihood import log_likelihood_gain, rms_difference
from anglecam.loop.policy import DEFAULT, Policy
from anglecam.loop.refit import effects_of, fit_at, plant_of
from anglecam.loop.screen import Forecast
from anglecam.threads import map_in_threads

LARGER = (2.0, 4.0, 8.0)
"""Multiples of a fitted size that are tried where it does not describe its effect."""


def find_rivals(
    best: Fit,
    base: Fit,
    records: Sequence[Record],
    effect: Effect,
    others: Sequence[Forecast],
    camera: float = 0.0,
    policy: Policy = DEFAULT,
) -> dict[str, Fit]:
    """Find every effect B that could have produced the data although ``effect``, A, explains them better.

    If B is true, log L(A) − log L(B) is normal with mean −d²/2 and variance d², where d is the distance, in standard
    deviations of the noise, from B's prediction to the nearest prediction of A (Cox, J. R. Statist. Soc. B 24, 1962).
    Whatever d is, the difference exceeds z²/2 no more often than a standard normal variable exceeds z. A is the best of
    several effects, and each of them can exceed it, so the rate is divided among them (Bonferroni). Each parameter that
    A has more than B follows noise, and counts one nat (Akaike). Where B's best fit does not describe B, the nearest
    one that does is judged. In a film, errors of the measurement may follow the motion, too, so a difference below the
    angle's uncertainty does not count.

    Parameters
    ----------
    best : Fit
        With ``effect``.
    base : Fit
        The same plant without it.
    records : sequence of Record
        The fitted recordings.
    effect : Effect
        A.
    others : sequence of Forecast
        Each a B.
    camera : float
        Stated standard uncertainty of a film's angle, rad; 0 for angle series from elsewhere.
    policy : Policy
        Thresholds.

    Returns
    -------
    dict
        Id of each B that cannot be excluded → the same plant with B in place of ``effect``.
    """

    def fit_rival(other: Forecast) -> Fit | None:
        return _nearest_possible(fit_with(base, records, other, camera=camera, policy=policy), records)

    others = [other for other in others if other.effect.id != effect.id]
    fits = [(other, fit) for other, fit in zip(others, map_in_threads(fit_rival, others), strict=True) if fit]
    widest = 0.5 * special.ndtri(policy.candidates.true_rival_rejection_rate / max(1, len(others))) ** 2

    def gap(fit: Fit) -> float:
        more = max(0, len(best.parameters) - len(fit.parameters))
        return log_likelihood_gain(fit.cost, best.cost, len(best.white)) - more

    return {other.effect.id: fit for other, fit in fits if gap(fit) <= widest or rms_difference(fit, best) <= camera}


def _nearest_possible(fit: Fit, records: Sequence[Record]) -> Fit | None:
    """Return a fit, or else one with a larger size of its last effect that describes that effect; see `is_possible`.

    A stop that is hardly touched is fitted as well by a spring that is softer than any stop.
    """
    name = effects_of(fit)[-1].parameters[0].name
    size = float(fit.parameters[fit.model.names.index(name)])
    tried = chain([fit], (fit_at(fit, name, times * size, records) for times in LARGER))
    return next((one for one in tried if is_possible(one, records)), None)


def is_possible(fit: Fit, records: Sequence[Record]) -> bool:
    """Return whether the parameters of a plant describe its effects at all; see `Effect.possible`."""
    plant = plant_of(fit)
    abc = np.zeros(3)
    abc[: plant.base_count] = fit.parameters[: plant.base_count]
    predicted = np.concatenate([r.angle - left for r, left in zip(records, fit.residuals, strict=True)])
    span = max(float(r.time[-1] - r.time[0]) for r in records)
    motion = Motion(float(predicted.min()), float(predicted.max()), usual_range(predicted), span)
    return all(
        effect.possible(tuple(values.tolist()), tuple(abc.tolist()), motion)
        for effect, values in plant.parameters_by_effect(fit.parameters)
    )
