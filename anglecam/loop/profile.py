"""The 95 % interval of one parameter from its profile likelihood.

At each value v of the parameter all other parameters are fitted again. The interval holds every v with

    (C(v) − C_min) / (k·s²) ≤ 3.84,      k = u²/u₀² ≥ 1

C is the sum of squared whitened residuals, so that the left side is twice the loss of log-likelihood for noise of the
residuals' variance s², divided by k. 3.84 is the 95 % point of χ² with one degree of freedom. u₀ is the standard
uncertainty that white residuals would give, and u includes correlated residuals and systematic errors of the
measurement (Chandler and Bate, Biometrika 94, 2007).

Where the interval reaches the value at which the effect is absent, its other end is an upper bound. The same threshold
serves for both, so the choice between bound and interval, which the data make, does not lower the confidence; a bound
then has at least 97.5 % (Feldman and Cousins, Phys. Rev. D 57, 1998; Self and Liang, J. Am. Stat. Assoc. 82, 1987).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from anglecam.data.record import Record
from anglecam.data.typing import Floats
from anglecam.effects import Parameter
from anglecam.identification.fit import Fit
from anglecam.identification.joined import join
from anglecam.identification.noise import Noise
from anglecam.identification.output_error import fit_output_error
from anglecam.identification.systematic import full_sigma
from anglecam.identification.variable_projection import point_at
from anglecam.loop.refit import fit_at, plant_of
from anglecam.models.plant import Plant

THRESHOLD = 3.841459
"""95 % point of χ² with one degree of freedom."""
TOLERANCE = 0.02
"""Share of an end's distance from the estimate to which the end is computed; it is rounded outwards."""
SMALLEST_STEP = 1e-3
"""First step of the search for an end where no standard uncertainty is known, as a share of the parameter's range."""
FARTHER = (0.5, 2.0)
"""Multiples of the distance from an end to the null, or to the estimate if that is farther, at which the likelihood is
computed once more: it may have a second maximum."""
SMALLEST_SIGMA = 1e-9
"""rad; data without noise are taken to have this, because models and files are no more accurate."""
MOST_DEVIANCE = 1e6
"""Larger deviances count as this, also those of a model that diverges."""
NEARLY_QUADRATIC = 0.1
"""The interval is value ± 1.96 u if the square root of the deviance errs by no more than this share at its ends."""
BETTER = 0.1
"""Gain in log-likelihood by which a fit on the way is a better estimate, from which the search begins again."""
MOST_RESTARTS = 3


@dataclass(frozen=True)
class Profile:
    """The profile likelihood of one parameter."""

    name: str
    """Name of the parameter."""
    best: Fit
    """With the parameter at its estimate."""
    estimate: float
    """SI."""
    null: float
    """Value at which the effect is absent, SI."""
    lower: float
    """Lower end of the 95 % interval, SI; −∞ where the recordings set none."""
    upper: float
    """Upper end, SI; ∞ where the recordings set none."""
    values: Floats
    """(n,) values at which the likelihood was computed, ascending, SI."""
    deviances: Floats
    """(n,) twice the loss of log-likelihood there, divided by k."""

    @property
    def excludes_null(self) -> bool:
        """Whether the recordings show that the effect is present."""
        return not self.lower <= self.null <= self.upper

    @property
    def is_limited(self) -> bool:
        """Whether the interval is finite on the far side of the null."""
        return math.isfinite(self.upper) and math.isfinite(self.lower)


def profile(
    best: Fit,
    name: str,
    records: Sequence[Record],
    noise: Noise,
    extra_sigma: float = 0.0,
    vanishing: int = 1,
) -> Profile:
    """Compute the 95 % interval of a parameter of a fitted plant.

    Parameters
    ----------
    best : Fit
        Of a `Plant` to ``records``.
    name : str
        The parameter.
    records : sequence of Record
        The fitted recordings.
    noise : Noise
        Of the angle.
    extra_sigma : float
        A further standard uncertainty of the parameter, SI, that the recordings do not show, such as a lamp's.
    vanishing : int
        Number of parameters that vanish where this one does, itself included. Absence is then excluded only at the
        95 % point of χ² with as many degrees of freedom.

    Returns
    -------
    Profile
        Its ends are infinite where no value up to the parameter's bound is excluded.
    """
    for _ in range(MOST_RESTARTS):
        found, better = _profile_once(best, name, records, noise, extra_sigma, vanishing)
        if better is None:
            break
        best = better
    return found


def interval_of(fit: Fit, name: str, records: Sequence[Record], noise: Noise) -> tuple[float, float]:
    """Return the 95 % interval of a parameter of a fitted plant: value ± 1.96 u, or the profile's where that fails.

    The standard uncertainty u is that of a quadratic log-likelihood. Whether the likelihood is quadratic is tested by
    its value at both ends.

    Parameters
    ----------
    fit : Fit
        Of a `Plant` to ``records``.
    name : str
        The parameter.
    records : sequence of Record
        The fitted recordings.
    noise : Noise
        Of the angle.

    Returns
    -------
    lower, upper : float
        SI; infinite where no value up to the parameter's bound is excluded.
    """
    estimate = float(fit.parameters[fit.model.names.index(name)])
    parameter = next(p for e in plant_of(fit).effects for p in e.parameters if p.name == name)
    sigma, inflation = _uncertainty(fit, name, records, noise, 0.0)
    half = math.sqrt(THRESHOLD) * sigma
    ends = (estimate - half, estimate + half)
    if math.isfinite(half) and parameter.lower <= ends[0] and ends[1] <= parameter.upper:
        variance = _variance(fit) * inflation * THRESHOLD
        share = [(fit_at(fit, name, end, records).cost - fit.cost) / variance for end in ends]
        if all(abs(math.sqrt(max(one, 0.0)) - 1.0) <= NEARLY_QUADRATIC for one in share):
            return ends
    found = profile(fit, name, records, noise)
    return found.lower, found.upper


def _variance(fit: Fit) -> float:
    """Return the variance of the whitened residuals, rad²."""
    return float(max(fit.cost / max(1, len(fit.white) - fit.slopes.rank), SMALLEST_SIGMA**2))


def _profile_once(
    best: Fit, name: str, records: Sequence[Record], noise: Noise, extra_sigma: float, vanishing: int
) -> tuple[Profile, Fit | None]:
    """Return the profile about an estimate, and a better estimate where one was found on the way."""
    place = best.model.names.index(name)
    parameter = next(p for e in plant_of(best).effects for p in e.parameters if p.name == name)
    estimate = float(best.parameters[place])
    sigma, inflation = _uncertainty(best, name, records, noise, extra_sigma)
    held: dict[float, Fit] = {}
    absence = float(special.chdtri(vanishing, 0.05))

    variance = _variance(best)

    def lost(fit: Fit) -> float:
        return (fit.cost - best.cost) / variance

    def loss(value: float) -> float:
        """Return twice the loss of log-likelihood at a value."""
        if value == estimate:
            return 0.0
        if value not in held:
            nearest = min(held, key=lambda v: abs(v - value), default=None)
            one = fit_at(best, name, value, records, None if nearest is None else held[nearest])
            if nearest is not None and lost(one) > THRESHOLD:  # no value is excluded by one local minimum
                one = min(one, fit_at(best, name, value, records), key=lambda fit: fit.cost)
            held[value] = one
        return lost(held[value])

    def ends(step: float, inflation: float) -> tuple[float, float]:
        def deviance(value: float) -> float:
            return loss(value) / inflation

        return (
            _end(deviance, estimate, -step, parameter.lower, parameter.null, absence),
            _end(deviance, estimate, step, parameter.upper, parameter.null, absence),
        )

    step = sigma if math.isfinite(sigma) and sigma > 0.0 else SMALLEST_STEP * (parameter.upper - parameter.lower)
    if math.isfinite(inflation):
        lower, upper = ends(step, inflation)
    else:  # the parameter has no effect at its estimate: take the uncertainties where it has one
        lower, upper = ends(step, 1.0)
        at = upper if math.isfinite(upper) else lower
        inflation = _inflation_at(best, name, at, held.get(at), records, noise, extra_sigma)
        lower, upper = ends(step, inflation)
    values = np.array(sorted({estimate, *held}))
    deviances = np.array([loss(float(value)) / inflation for value in values])
    found = Profile(name, best, estimate, parameter.null, lower, upper, values, deviances)
    lowest = min(held, key=loss, default=estimate)
    if loss(lowest) > -2.0 * BETTER:
        return found, None
    start = np.insert(held[lowest].parameters, place, lowest)
    return found, fit_output_error(best.model, records, [start], nuisance=held[lowest].nuisance, phi=best.phi)


def _end(
    deviance: Callable[[float], float],
    estimate: float,
    step: float,
    bound: float,
    null: float,
    absence: float = THRESHOLD,
    inside: float | None = None,
) -> float:
    """Return the end of the interval on one side, rounded outwards; the null if it is inside, or infinity.

    The null is inside up to the deviance ``absence``. ``inside`` is a value that is known to lie in the interval, the
    estimate by default.
    """
    side = math.copysign(1.0, step)
    if estimate == bound:
        return bound if bound == null else side * math.inf
    inside = estimate if inside is None else inside
    outside = bound if bound == null and deviance(bound) > absence else None
    if bound == null and outside is None:
        return bound
    while outside is None:
        tried = bound if side * (estimate + step - bound) >= 0.0 else estimate + step
        if deviance(tried) > THRESHOLD:
            outside = tried
        elif tried == bound:
            return side * math.inf
        else:
            inside, step = tried, 2.0 * step
    outside = _refined(deviance, estimate, inside, outside)
    reach = max(abs(outside - estimate), abs(outside - null))
    for factor in FARTHER if bound != null else ():
        tried = outside + side * factor * reach
        if side * (tried - bound) < 0.0 and deviance(tried) <= THRESHOLD:
            # the search goes on from there, or it would meet the same end again
            return _end(deviance, estimate, 2.0 * (tried - estimate), bound, null, absence, inside=tried)
    return outside


def _refined(deviance: Callable[[float], float], estimate: float, inside: float, outside: float) -> float:
    """Return a value just outside the interval, between one inside and one outside."""
    wanted, halve = math.sqrt(THRESHOLD), False
    while abs(outside - inside) > TOLERANCE * abs(outside - estimate):
        # the root of the deviance is nearly linear, but for a limit that sets in at once
        low, high = math.sqrt(max(deviance(inside), 0.0)), math.sqrt(min(deviance(outside), MOST_DEVIANCE))
        share = 0.5 if halve else min(max((wanted - low) / (high - low) + 0.5 * TOLERANCE, 0.05), 0.95)
        tried, halve = inside + share * (outside - inside), not halve
        if deviance(tried) > THRESHOLD:
            outside = tried
        else:
            inside = tried
    return outside


def _uncertainty(
    fit: Fit, name: str, records: Sequence[Record], noise: Noise, extra_sigma: float
) -> tuple[float, float]:
    """Return the standard uncertainty of a parameter, SI, and k; NaN if it changes no prediction.

    The parameter's bounds are left out: at a bound the uncertainty is that of a value inside.
    """
    place = fit.model.names.index(name)
    unbounded = replace(fit, model=_without_bounds(plant_of(fit), name))
    white = float(unbounded.covariance[place, place])
    whole = float(full_sigma(unbounded, records, noise)[place]) ** 2 + extra_sigma**2
    return math.sqrt(whole), max(1.0, whole / white) if white > 0.0 else math.nan


def _inflation_at(
    best: Fit,
    name: str,
    value: float,
    held: Fit | None,
    records: Sequence[Record],
    noise: Noise,
    extra_sigma: float,
) -> float:
    """Return k with the parameter at another value than its estimate; 1 where it has no effect there, either."""
    if held is None:
        return 1.0
    parameters = np.insert(held.parameters, best.model.names.index(name), value)
    joined = join(records, best.phi)
    here = point_at(best.model, joined, parameters, joined.stack(held.nuisance))
    slopes = joined.slopes(best.model, parameters, here.own, here.predicted)
    there = replace(best, parameters=parameters, residuals=held.residuals, slopes=slopes, white=held.white)
    inflation = _uncertainty(there, name, records, noise, extra_sigma)[1]
    return inflation if math.isfinite(inflation) else 1.0


def _without_bounds(plant: Plant, name: str) -> Plant:
    """Return a plant with one parameter unbounded."""

    def free(p: Parameter) -> Parameter:
        return replace(p, lower=-math.inf, upper=math.inf) if p.name == name else p

    return replace(plant, effects=tuple(replace(e, parameters=tuple(map(free, e.parameters))) for e in plant.effects))
