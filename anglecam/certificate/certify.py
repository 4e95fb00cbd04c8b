"""Certify a servo: fit each quantity with the effects that the verdict accepted, and compute its interval.

    model so far = plant with the accepted effects,   + the quantity's effect where it is not among them

An accepted effect has rivals where the recordings cannot distinguish it. Its interval then leaves each rival open, one
at a time, and covers all of these intervals. Otherwise it would hold only if the right one of the alias set was named.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from anglecam.certificate.quantity import QUANTITIES, Quantity, with_breakaway
from anglecam.effects import Effect
from anglecam.identification.fit import Fit
from anglecam.identification.output_error import fit_best_start, fit_output_error, output_error
from anglecam.loop.fit_effect import fit_with
from anglecam.loop.next_experiment.design import Experiment, separating_experiment
from anglecam.loop.profile import Profile, profile
from anglecam.loop.refit import effects_of, fit_at, plant_of
from anglecam.loop.screen import changes, directions, forecasts
from anglecam.loop.stepwise import applicable
from anglecam.loop.verdict import Accepted, Verdict
from anglecam.models.plant import FASTEST, Plant
from anglecam.progress import Progress, Stage, unseen
from anglecam.threads import map_in_threads

BREAKAWAY_STARTS = 6
"""Starts of the breakaway level from which a fit is made: those with the smallest cost before fitting."""


@dataclass(frozen=True)
class Clock:
    """How command and angle share a clock."""

    lamp: bool
    """Whether a lamp in the picture shows the first change of the command."""
    sigma: float = 0.0
    """Standard uncertainty of the instant at which the lamp lit, s."""
    one_log: bool = False
    """Whether an encoder's angle and the command were logged by one clock."""

    @property
    def shared(self) -> bool:
        """Whether a delay is the servo's alone, and not the sum with an offset between two clocks."""
        return self.lamp or self.one_log


NO_LAMP = Clock(False)
ONE_LOG = Clock(False, one_log=True)


@dataclass(frozen=True)
class Certified:
    """One quantity of a certificate."""

    quantity: Quantity
    profile: Profile | None
    """``None`` where the recordings cannot show the effect, or the model cannot be fitted with it."""
    interval: tuple[float, float]
    """95 % interval of the parameter, SI, with every rival left open; infinite where there is no end."""
    accepted: bool
    """Whether the verdict attributes the effect."""
    rivals: tuple[str, ...]
    """Effects that the recordings cannot distinguish from it; none where the effect was not accepted."""
    experiment: Experiment | None = None
    """The recording that would determine the quantity, where these do not and one was found."""

    @property
    def state(self) -> str:
        """``measured`` (the interval excludes absence), ``bounded`` (one end only) or ``not_determined``."""
        lower, upper = self.interval
        if self.profile is None or not math.isfinite(upper) or not math.isfinite(lower):
            return "not_determined"
        return "bounded" if lower <= self.profile.null <= upper else "measured"


@dataclass(frozen=True)
class Certificate:
    """What recordings show of a servo."""

    verdict: Verdict
    quantities: tuple[Certified, ...]
    clock: Clock

    @property
    def holds(self) -> bool:
        """Whether the model leaves no structure, which its intervals presuppose."""
        return self.verdict.verdict in ("attributed", "nothing_missing")

    @property
    def is_certified(self) -> bool:
        """Whether the model explains enough of the motion for its intervals to be stated, if with a doubt."""
        return self.holds or self.verdict.verdict == "partly_explained"

    def certifies(self, one: Certified) -> bool:
        """Return whether a quantity's value is stated.

        Where structure remains, an effect that the verdict does not name may be seen only because it takes up a part of
        that structure.
        """
        return self.holds or (self.is_certified and (one.accepted or one.state != "measured"))


def certify(verdict: Verdict, clock: Clock = NO_LAMP, progress: Progress = unseen) -> Certificate:
    """Compute the certificate of the servo in a session's recordings.

    Parameters
    ----------
    verdict : Verdict
        From `anglecam.loop.close.close_records`; its fitted recordings are used.
    clock : Clock
        Of the session.
    progress : Progress
        Called with each stage.

    Returns
    -------
    Certificate
        With every quantity of `QUANTITIES`.
    """
    rate = plant_of(verdict.after).fastest / FASTEST
    ledger = {e.id: e for e in applicable([*verdict.fitted, *verdict.held_out], rate)}
    progress(Stage("working out the servo's intervals"))
    with threadpool_limits(1, "blas"):
        found = map_in_threads(lambda one: _certified(verdict, one, ledger.get(one.effect_id), clock), QUANTITIES)
        progress(Stage("designing experiments"))
        whole = tuple(_with_experiment(verdict, one) if one.state == "not_determined" else one for one in found)
    return Certificate(verdict, whole, clock)


def _certified(verdict: Verdict, quantity: Quantity, effect: Effect | None, clock: Clock) -> Certified:
    """Certify one quantity; ``effect`` is ``None`` where the recordings cannot show it at all."""
    accepted = next((a for a in verdict.accepted if a.effect.id == quantity.effect_id), None)
    nothing = Certified(quantity, None, (-math.inf, math.inf), accepted is not None, ())
    if effect is None:
        return nothing
    fit = verdict.after if accepted else _with_effect(verdict, _bounded(effect, clock))
    if fit is not None and quantity.id == "breakaway_friction":
        fit = _with_breakaway(verdict, fit, effect)
    if fit is None:
        return nothing
    extra = clock.sigma if quantity.effect_id == "dead_time" else 0.0
    fits = [fit, *(_rival_fits(verdict, accepted, fit) if accepted else ())]
    profiles = [
        profile(one, quantity.parameter, verdict.fitted, verdict.noise, extra, quantity.vanishing) for one in fits
    ]
    interval = min(p.lower for p in profiles), max(p.upper for p in profiles)
    return Certified(quantity, profiles[0], interval, accepted is not None, accepted.alias_set[1:] if accepted else ())


def _bounded(effect: Effect, clock: Clock) -> Effect:
    """Return dead time without negative values where the command's clock is known; other effects as they are."""
    if effect.id != "dead_time" or not clock.shared:
        return effect
    size = effect.parameters[0]
    return replace(effect, parameters=(replace(size, lower=0.0, starts=tuple(s for s in size.starts if s > 0.0)),))


def _with_effect(verdict: Verdict, effect: Effect) -> Fit | None:
    """Fit the final model with one more effect; ``None`` where the model can follow all that the effect changes."""
    base, records, policy = verdict.after, verdict.fitted, verdict.policy
    ranked = forecasts(base, directions(base, records, changes(base, records, [effect]), policy))
    if not ranked:
        return None
    fit = fit_with(base, records, ranked[0], staged=False, policy=policy)
    absent = np.append(base.parameters, [p.null for p in effects_of(fit)[-1].parameters])
    without = fit_output_error(fit.model, records, [absent], nuisance=base.nuisance, phi=base.phi)
    best = min(fit, without, key=lambda one: one.cost)
    return best if math.isfinite(best.cost) else None


def _with_breakaway(verdict: Verdict, fit: Fit, friction: Effect) -> Fit:
    """Fit dry friction's breakaway level in place of the excess; ``fit`` holds dry friction without or with it."""
    level = with_breakaway(friction)
    values = dict(zip(fit.model.names, fit.parameters, strict=True))
    others = [e for e in effects_of(fit) if e.id != friction.id]
    plant = replace(plant_of(fit), effects=(*others, level))
    size, last = level.parameters[0], level.parameters[-1]
    sliding = values[size.name]
    excesses = {values.get("breakaway_excess_deg_per_s2", 0.0), *last.starts}
    starts = [
        np.array([(values | {size.name: f, last.name: min(f + more, last.upper)}).get(n, 0.0) for n in plant.names])
        for f in {sliding, *size.starts[: 1 if sliding > 0.0 else 2]}
        for more in excesses
    ]
    starts.sort(key=lambda one: output_error(plant, one, verdict.fitted, fit.nuisance, fit.phi))
    return fit_best_start(plant, verdict.fitted, starts[:BREAKAWAY_STARTS], fit.nuisance, fit.phi)


def _rival_fits(verdict: Verdict, accepted: Accepted, fit: Fit) -> list[Fit]:
    """Fit the model with each rival of an accepted effect in addition to it."""
    fits = []
    values = dict(zip(fit.model.names, fit.parameters, strict=True))
    for rival in accepted.rivals.values():
        effect = effects_of(rival)[-1]
        plant = plant_of(fit).with_effect(effect)
        there = dict(zip(rival.model.names, rival.parameters, strict=True))
        nulls = {p.name: p.null for e in plant.effects for p in e.parameters}
        starts = [nulls | values, nulls | there]
        ordered = [np.array([one[name] for name in plant.names]) for one in starts]
        fits.append(fit_output_error(plant, verdict.fitted, ordered, nuisance=fit.nuisance, phi=fit.phi))
    return fits


def _with_experiment(verdict: Verdict, one: Certified) -> Certified:
    """Add the recording that distinguishes a plain size of a quantity's effect from its absence."""
    if one.profile is None:
        return one
    fit, size = one.profile.best, _size(one.profile.best, one.quantity)
    absent = fit_at(fit, one.quantity.parameter, one.profile.null, verdict.fitted)
    present = fit_at(fit, one.quantity.parameter, size, verdict.fitted)
    pair: Sequence[Fit] = (_renamed(absent, one.quantity), present)
    experiment = separating_experiment(pair, verdict.fitted, verdict.noise, verdict.policy)
    return replace(one, experiment=experiment if experiment is not None and experiment.separated else None)


def _size(fit: Fit, quantity: Quantity) -> float:
    """Return a plain size of a quantity's parameter, SI: the middle of its starts."""
    starts = next(p.starts for e in effects_of(fit) for p in e.parameters if p.name == quantity.parameter)
    return float(np.median([s for s in starts if s > 0.0]))


def _renamed(fit: Fit, quantity: Quantity) -> Fit:
    """Return a fit of a plant without the effect that is held absent, which the experiment's names then show."""
    plant: Plant = plant_of(fit)
    left = tuple(e for e in plant.effects if e.id != quantity.effect_id or e.parameters)
    return replace(fit, model=replace(plant, effects=left))
