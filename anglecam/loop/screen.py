"""The screen: in which direction each effect would move the predictions, and how far the residual goes that way.

An effect at one of its starts changes the predictions. What the fit so far cannot follow of that change, and the
residual shows, is what the effect could explain: with d the change and r the residual, both whitened and free of what
the Jacobian spans, the best multiple of d lowers the cost by (d·r)²/d·d. That is exact where the effect is small and
acts in proportion, and good enough to choose by elsewhere: backlash, limits and dead zones have no derivative at their
null, but a change at a start they have.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from anglecam.data.record import Record
from anglecam.data.typing import Floats
from anglecam.effects import Effect
from anglecam.identification.fit import Fit, whiten
from anglecam.loop.refit import plant_of
from anglecam.models.plant import Plant

STEPS = (0.0003, 0.003, 0.03, 0.3)
"""Shares of a start at which an effect is also tried: small ones are far from their starts."""
LEAST = 1e-6
"""A change of which the fit follows all but this share is no direction of its own."""


@dataclass(frozen=True)
class Change:
    """What an effect does to the predictions at one set of its parameters."""

    effect: Effect
    start: Floats
    """Its parameters, SI."""
    parts: tuple[Floats, ...] = field(repr=False)
    """Change of each recording's prediction, rad."""


@dataclass(frozen=True)
class Direction:
    """The part of a change that no parameter of the fit could bring about."""

    effect: Effect
    start: Floats
    """Its parameters, SI."""
    change: Floats = field(repr=False)
    """(N,) change of the whitened predictions, free of what the fit can follow, rad."""

    @property
    def size(self) -> float:
        """Length of ``change``, rad."""
        return float(np.linalg.norm(self.change))

    @property
    def one_sided(self) -> bool:
        """Whether the effect exists on one side of its null only."""
        first = self.effect.parameters[0]
        return first.null in (first.lower, first.upper)


@dataclass(frozen=True)
class Forecast:
    """What one effect promises."""

    effect: Effect
    start: Floats
    """Its parameters, SI, scaled to what the residual asks for where they can be scaled."""
    tried: Floats
    """The same as they were tried."""
    gain: float
    """Log-likelihood that the fit would gain."""
    share: float = 1.0
    """Of the most that is forecast to any effect."""


def absorbed_space(fit: Fit) -> Floats:
    """Return an orthonormal basis, (N, k), of the changes that the fit follows with its own parameters."""
    used = np.linalg.norm(fit.jacobian, axis=0) > 0.0  # a parameter held by its bound may move nothing
    basis, _ = np.linalg.qr(fit.jacobian[:, used])
    return basis


def changes(fit: Fit, records: Sequence[Record], effects: Sequence[Effect]) -> list[Change]:
    """Return what each effect at each of its starts does to the predictions of a fitted plant.

    Parameters
    ----------
    fit : Fit
        Of a `Plant`, the model so far.
    records : sequence of Record
        Those that it was fitted to.
    effects : sequence of Effect
        What could be added.

    Returns
    -------
    list of Change
        Grouped by effect; those with which the plant runs away left out.
    """
    plant = plant_of(fit)
    found = []
    for effect in effects:
        richer = plant.with_effect(effect)

        def predict(own_parameters: Floats, richer: Plant = richer) -> list[Floats]:
            values = np.append(fit.parameters, own_parameters)
            return [
                richer.predict(values, record.time, record.command, own[: plant.states], record.view)
                for record, own in zip(records, fit.nuisance, strict=True)
            ]

        base = predict(effect.null)  # with the effect in place: what the integrator errs by is the same then
        for start in starts_of(effect):
            parts = tuple(after - before for after, before in zip(predict(start), base, strict=True))
            if all(np.all(np.isfinite(part)) for part in parts):
                found.append(Change(effect, start, parts))
    return found


def directions(fit: Fit, records: Sequence[Record], moved: Sequence[Change]) -> list[Direction]:
    """Return the changes as the fit sees them: whitened with its noise, and free of what it can follow.

    Parameters
    ----------
    fit : Fit
        The model so far.
    records : sequence of Record
        Those that it was fitted to.
    moved : sequence of Change
        From `changes` of the same fit, or of one before that whitened with another colour.

    Returns
    -------
    list of Direction
        Those left out of which the fit follows everything.
    """
    absorbed, found = absorbed_space(fit), []
    for one in moved:
        change = np.concatenate([whiten(r, fit.phi, part) for r, part in zip(records, one.parts, strict=True)])
        whole = float(np.linalg.norm(change))
        change = change - absorbed @ (absorbed.T @ change)
        if np.linalg.norm(change) > LEAST * whole:
            found.append(Direction(one.effect, one.start, change))
    return found


def starts_of(effect: Effect) -> list[Floats]:
    """List the parameters that an effect is tried with: its size at every start, its shape with the first of them.

    Late ones stay at their null.
    """
    size = effect.parameters[0]
    first = size.starts[0]
    starts = []
    for i, parameter in enumerate(effect.parameters):
        for value in () if parameter.staged else parameter.starts:
            own = effect.null
            own[0], own[i] = first, value
            starts.append(own)
    for share in STEPS:
        small = effect.null
        small[0] = size.null + share * (first - size.null)
        starts.append(small)
    return starts


def forecasts(fit: Fit, ways: Sequence[Direction]) -> list[Forecast]:
    """Forecast what each effect would explain, from its most promising direction.

    Parameters
    ----------
    fit : Fit
        The model so far.
    ways : sequence of Direction
        From `directions` of the same fit.

    Returns
    -------
    list of Forecast
        One an effect, most promising first.
    """
    absorbed = absorbed_space(fit)
    left = fit.white - absorbed @ (absorbed.T @ fit.white)
    energy = float(left @ left)
    best: dict[str, Forecast] = {}
    for way in ways:
        one = _forecast(way, left, energy)
        if way.effect.id not in best or one.gain > best[way.effect.id].gain:
            best[way.effect.id] = one
    most = max((forecast.gain for forecast in best.values()), default=0.0)
    shares = [replace(forecast, share=forecast.gain / most if most > 0.0 else 1.0) for forecast in best.values()]
    return sorted(shares, key=lambda forecast: -forecast.gain)


def _forecast(way: Direction, left: Floats, energy: float) -> Forecast:
    size, along = way.size**2, float(way.change @ left)
    null, first = way.effect.null, way.effect.parameters[0]
    reach = way.start[0] - null[0]
    wanted = float(np.clip(null[0] + along / size * reach, first.lower, first.upper))
    share = (wanted - null[0]) / reach
    lowered = energy - 2.0 * share * along + share**2 * size
    gain = 0.5 * len(left) * math.log(energy / max(lowered, 1e-6 * energy)) if energy > 0.0 else 0.0
    scaled = way.start.copy()
    scaled[0] = wanted if wanted != null[0] else way.start[0]
    return Forecast(way.effect, scaled, way.start, gain)
