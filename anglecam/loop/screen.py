"""The screen: a linear forecast of how much of the residual each effect would explain.

An effect with start values for its parameters changes the predictions. Let d be this change and r the residual, both
whitened and projected onto the orthogonal complement of the fit's Jacobian. The best multiple of d lowers the cost by
(d·r)²/d·d. This is exact for a small effect whose change is proportional to its parameter, and accurate enough to rank
the others: backlash, limits and dead zones have no derivative at their null, but they change the predictions at a start
value.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from anglecam.data.record import Record
from anglecam.data.runs import runs_of
from anglecam.data.typing import Floats
from anglecam.effects import Effect
from anglecam.effects.seen import Seen
from anglecam.identification.fit import Fit
from anglecam.identification.joined import RUNAWAY, join
from anglecam.loop.policy import DEFAULT, Policy
from anglecam.loop.refit import plant_of
from anglecam.loop.seen import seen_of
from anglecam.models.plant import Plant

START_SHARES = (0.0003, 0.003, 0.03, 0.3)
"""Shares of a start value at which an effect is tried as well, because a small effect is far from its start value."""


@dataclass(frozen=True)
class Change:
    """Change that an effect with given parameters makes to the predictions."""

    effect: Effect
    start: Floats
    """Parameters of the effect, SI."""
    angle: Floats = field(repr=False)
    """(N,) change of the predictions of all recordings, rad."""
    likeliest: Floats
    """The first of the effect's start values, SI."""


@dataclass(frozen=True)
class Direction:
    """The part of a change that no parameter of the fit can reproduce."""

    effect: Effect
    start: Floats
    """Parameters of the effect, SI."""
    change: Floats = field(repr=False)
    """(N,) change of the whitened predictions, orthogonal to the fit's Jacobian, rad."""
    likeliest: Floats
    """The first of the effect's start values, SI."""

    @property
    def size(self) -> float:
        """Euclidean norm of ``change``, rad."""
        return float(np.linalg.norm(self.change))

    @property
    def one_sided(self) -> bool:
        """Whether the first parameter can lie on one side of its null only."""
        first = self.effect.parameters[0]
        return first.null in (first.lower, first.upper)


@dataclass(frozen=True)
class Forecast:
    """How much one effect is expected to explain."""

    effect: Effect
    start: Floats
    """Parameters of the effect, SI; the first is scaled to the best multiple of the change."""
    tried: Floats
    """The same parameters before scaling."""
    likeliest: Floats
    """The first of the effect's start values, SI."""
    gain: float
    """Expected log-likelihood gain, nat."""
    share: float = 1.0
    """``gain`` as a share of the largest forecast of any effect."""


def changes(fit: Fit, records: Sequence[Record], effects: Sequence[Effect]) -> list[Change]:
    """Return the change that each effect, at each of its start values, makes to the predictions of a fitted plant.

    Parameters
    ----------
    fit : Fit
        Of a `Plant`, the model so far.
    records : sequence of Record
        The recordings that it was fitted to.
    effects : sequence of Effect
        Effects that could be added.

    Returns
    -------
    list of Change
        Grouped by effect, without those that make the plant's motion diverge.
    """
    plant, runs = plant_of(fit), runs_of(records)
    first = np.stack([nuisance[: plant.states] for nuisance in fit.nuisance])
    seen, found = seen_of(fit, records), []
    for effect in effects:
        richer = plant.with_effect(effect)

        def predict(effect_parameters: Floats, richer: Plant = richer) -> Floats:
            return richer.predict_all(np.append(fit.parameters, effect_parameters), runs, first)[0]

        base = predict(effect.null)  # with the effect in the model, so that errors of the integrator cancel
        if not np.all(np.abs(base) < RUNAWAY):
            continue
        starts = starts_of(effect, seen)
        for start in starts:
            changed = predict(start)
            if np.all(np.abs(changed) < RUNAWAY):
                found.append(Change(effect, start, changed - base, starts[0]))
    return found


def directions(
    fit: Fit, records: Sequence[Record], prediction_changes: Sequence[Change], policy: Policy = DEFAULT
) -> list[Direction]:
    """Whiten the changes as the fit whitens its residual, and remove the part that its parameters can reproduce.

    Parameters
    ----------
    fit : Fit
        The model so far.
    records : sequence of Record
        The recordings that it was fitted to.
    prediction_changes : sequence of Change
        From `changes` of the same fit, or of a previous one with another AR(1) coefficient.
    policy : Policy
        Thresholds.

    Returns
    -------
    list of Direction
        Without changes that the fit can reproduce completely.
    """
    joined, found = join(records, fit.phi), []
    for one in prediction_changes:
        change = joined.whiten(one.angle)
        whole = float(np.linalg.norm(change))
        change = fit.slopes.without_followed(change)
        if np.linalg.norm(change) > policy.screen.smallest_free_share * whole:
            found.append(Direction(one.effect, one.start, change, one.likeliest))
    return found


def starts_of(effect: Effect, seen: Seen) -> list[Floats]:
    """List the parameters at which an effect is tried.

    An effect that works out its starts is tried at those. Otherwise the first parameter takes every start value, and
    each other one its start values with the first at its first start value. Staged parameters stay at their null. The
    first start is tried with smaller sizes as well.

    Parameters
    ----------
    effect : Effect
        An effect that could be added.
    seen : Seen
        Of the model so far.

    Returns
    -------
    list of (k,) ndarray
        SI; never empty.
    """
    size, starts = effect.parameters[0], []
    if effect.starts is not None:
        places = [place for place, _ in effect.fixed]
        whole = [np.delete(np.array(start, dtype=float), places) for start in effect.starts(seen)]
        starts = [np.clip(start, *effect.bounds) for start in whole]
    else:
        for i, parameter in enumerate(effect.parameters):
            for value in () if parameter.staged else parameter.starts:
                values = effect.null
                values[0], values[i] = size.starts[0], value
                starts.append(values)
    for share in START_SHARES:
        small = starts[0].copy()
        small[0] = size.null + share * (starts[0][0] - size.null)
        starts.append(small)
    return list({start.tobytes(): start for start in starts}.values())


def forecasts(fit: Fit, effect_directions: Sequence[Direction]) -> list[Forecast]:
    """Forecast the log-likelihood gain of each effect from its best direction.

    Parameters
    ----------
    fit : Fit
        The model so far.
    effect_directions : sequence of Direction
        From `directions` of the same fit.

    Returns
    -------
    list of Forecast
        One for each effect, largest gain first.
    """
    left = fit.slopes.without_followed(fit.white)
    energy = float(left @ left)
    best: dict[str, Forecast] = {}
    for direction in effect_directions:
        one = _forecast(direction, left, energy)
        if direction.effect.id not in best or one.gain > best[direction.effect.id].gain:
            best[direction.effect.id] = one
    most = max((forecast.gain for forecast in best.values()), default=0.0)
    shares = [replace(forecast, share=forecast.gain / most if most > 0.0 else 1.0) for forecast in best.values()]
    return sorted(shares, key=lambda forecast: -forecast.gain)


def _forecast(direction: Direction, left: Floats, energy: float) -> Forecast:
    size, along = direction.size**2, float(direction.change @ left)
    null, first = direction.effect.null, direction.effect.parameters[0]
    reach = direction.start[0] - null[0]
    best_first = float(np.clip(null[0] + along / size * reach, first.lower, first.upper))
    share = (best_first - null[0]) / reach
    lowered = energy - 2.0 * share * along + share**2 * size
    gain = 0.5 * len(left) * math.log(energy / max(lowered, 1e-6 * energy)) if energy > 0.0 else 0.0
    scaled = direction.start.copy()
    scaled[0] = best_first if best_first != null[0] else direction.start[0]
    return Forecast(direction.effect, scaled, direction.start, direction.likeliest, gain)
