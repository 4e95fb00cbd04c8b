"""The alternation: the appearance for given angles and centres, then angles and centres for that appearance.

An appearance with a small error agrees with the angles from which it was learnt, so the steps shrink slowly, each error
by the share of it that the appearance absorbs. After the first rounds the steps are therefore extended
(`anglecam.vision.registration.acceleration`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats
from anglecam.threads import map_in_threads
from anglecam.vision.registration.acceleration import AitkenSteps, AndersonSteps, PlainSteps
from anglecam.vision.registration.appearance import (
    HIDDEN_MISFIT,
    TileAppearance,
    TileFit,
    TileViews,
    compare_tiles,
    equalise_brightness,
    learn_tile,
)
from anglecam.vision.registration.axis_view import AxisView
from anglecam.vision.registration.centre_equations import (
    PIVOT,
    Centres,
    centre_derivatives,
    centre_equations,
    displacement_scatter,
    heights_of,
    leans_of,
    remaining_gradient,
    solve_centres,
)
from anglecam.vision.registration.tiles import TILE_SIDE_PX, Tiles
from anglecam.vision.registration.turn import covered_views

_MAX_ROUNDS = 32
_SETTLED_PX = 0.002
"""Change of the centres of rotation below which the iteration ends, px."""
_HIDDEN_ROUNDS = 3
"""Rounds after which the set of hidden views is no longer changed."""
_WEIGHING_ROUNDS = 6
"""Rounds after which the tiles' weights are no longer changed."""
_MIN_VARIANCE = 0.5
"""Least variance of a tile relative to the median. A smaller variance results from too few views, not from less
noise."""
_EXACT = 1e-6
"""Least variance of a tile, grey levels squared: of equal pictures, or of a tile that no view shows."""
_NO_MISFIT = 1e-9
"""Replaces the usual misfit, zero, of a tile that is outside most pictures."""
_MEDIAN_OF_SQUARES = 0.455
"""Median of the square of a standard normal variable."""
_LEAST_SPREAD_PX = 0.003
"""Least standard deviation of the centres of rotation that heights cause: a body is never known to be flatter, px."""


@dataclass(frozen=True)
class State:
    """The unknowns besides the appearance."""

    centres: Centres
    """Pivot and direction relative to the initial ones."""
    turns: Floats
    """(frames,) rad."""
    height_variance: float
    """Of the distribution of the heights, px²."""
    lean_variance: float
    """Of the distribution of the leans."""
    scale: Floats
    """(3 + 3·tiles + frames,) px of each unknown's unit."""

    def moved(self, step: Floats, following: State) -> State:
        """Return the state after a step as from `step_to`, with the distributions of another state."""
        centres, turns = np.split(step / self.scale, [len(self.centres.values)])
        return replace(following, centres=Centres(self.centres.values + centres), turns=self.turns + turns)

    def step_to(self, other: State) -> Floats:
        """Return the step from this state to another, all components in px."""
        step = other.centres.values - self.centres.values
        return np.asarray(np.concatenate([step, other.turns - self.turns]) * self.scale)


@dataclass(frozen=True)
class Data:
    """Everything that stays the same from round to round."""

    tiles: Tiles
    views: Sequence[TileViews]
    """One for each tile."""
    start_px: Floats
    """(2,) the initial pivot."""
    axis: AxisView
    """As initially assumed. It determines which unknowns are free."""
    prior: Floats
    """(3, 3) prior information on pivot and direction, 1/px² and 1/rad²."""
    wander_px: Floats
    """(frames, 2) displacement of the pivot in each frame; zero if it stands still."""

    @property
    def free(self) -> NDArray[np.intp]:
        """Places of the free unknowns: pivot, heights if the axis is seen as a line, all if it is estimated."""
        size = 3 + 3 * len(self.tiles.heights)
        if self.axis.estimated:
            return np.arange(size)
        pivot = np.arange(size)[PIVOT]
        return np.append(pivot, np.arange(size)[heights_of(size)]) if self.axis.parallax.any() else pivot

    def axis_in(self, state: State) -> AxisView:
        """Return how the axis is seen in a state."""
        return self.axis.turned(state.centres.direction)

    def centres(self, state: State) -> Floats:
        """Return the centre of rotation of each tile, (tiles, 2) px."""
        along = state.centres.heights[:, None] * self.axis_in(state).parallax
        return np.asarray(self.start_px + state.centres.pivot + along)

    def by_unknown(self, state: State) -> Floats:
        """Return the derivatives (tiles, 4, free) from `centre_derivatives`."""
        return centre_derivatives(self.axis_in(state), state.centres.heights)[..., self.free]

    def seen(self, state: State) -> list[TileViews]:
        """Return the views with offsets from those centres."""
        off = self.centres(state) - (self.start_px + self.tiles.heights[:, None] * self.axis.parallax)
        return [
            replace(v, offsets=v.offsets - shift - np.repeat(self.wander_px, np.diff(v.starts), axis=0))
            for v, shift in zip(self.views, off, strict=True)
        ]

    def prior_in(self, state: State) -> Floats:
        """Return the prior information (free, free)."""
        size = len(state.centres.values)
        whole = np.eye(size)
        whole[:3, :3] = self.prior
        whole[heights_of(size), heights_of(size)] /= state.height_variance
        whole[leans_of(size), leans_of(size)] /= state.lean_variance
        return whole[np.ix_(self.free, self.free)]


@dataclass(frozen=True)
class Round:
    """One round: the appearance for a state, and the state that follows from it."""

    appearance: Sequence[TileAppearance]
    """One for each tile."""
    hidden: NDArray[np.bool_]
    """(tiles, frames) views in which something covers the tile."""
    variance: Floats
    """(tiles,) mean squared residual, grey levels squared."""
    excess: Floats
    """(tiles,) factor of the variances with which the state was found."""
    scatter: Floats
    """(tiles,) mean square of the displacements that remain, in units of the noise."""
    covariance: Floats
    """Of the free unknowns for a known appearance, in units of the pixels' noise."""
    state: State
    fits: TileFit
    """Of the appearance, in the state for which it was learnt."""


def alternate(data: Data, state: State) -> Round:
    """Alternate between appearance and state until the centres of rotation settle; return the last round."""
    appearance = _learn_all(data, data.seen(state).__getitem__, state)
    now = one_round(data, state, appearance, None, np.ones(len(appearance)))
    accelerated, origin = _acceleration(data.axis), state
    for done in range(1, _MAX_ROUNDS):
        if np.hypot(*(data.centres(now.state) - data.centres(state)).T).max() < _SETTLED_PX:
            break
        step = accelerated.extended(origin.step_to(state), state.step_to(now.state), done > _HIDDEN_ROUNDS)
        state = state.moved(step, now.state)
        hidden = now.hidden if done >= _HIDDEN_ROUNDS else None
        weighing = data.axis.estimated and done < _WEIGHING_ROUNDS
        excess = np.maximum(now.scatter, 1.0) if weighing else now.excess
        now = one_round(data, state, now.appearance, hidden, excess, now.fits)
    return now


def _acceleration(axis: AxisView) -> PlainSteps:
    if axis.estimated:
        return AndersonSteps()
    # In a tilted view the heights converge at different rates, so no single ratio exists to extrapolate with.
    return PlainSteps() if axis.parallax.any() else AitkenSteps()


def one_round(
    data: Data,
    state: State,
    appearance: Sequence[TileAppearance],
    hidden: NDArray[np.bool_] | None,
    excess: Floats,
    before: TileFit | None = None,
) -> Round:
    """Learn the appearance for a state, then the state for that appearance.

    Parameters
    ----------
    data : Data
        The views.
    state : State
        Angles and centres.
    appearance : sequence of TileAppearance
        Of the round before.
    hidden : ndarray, optional
        (tiles, frames) views in which something covers the tile; found anew by default.
    excess : ndarray
        (tiles,) factor of the variances.
    before : TileFit, optional
        The fits of that appearance in the state for which it was learnt; computed by default.
    """
    views, centres = data.seen(state), data.centres(state)
    before = compare_all(appearance, views, state.turns, centres) if before is None else before
    out = _hidden(before) if hidden is None else hidden

    def kept(t: int) -> TileViews:
        return equalise_brightness(views[t], before.light[t]).without(out[t])

    appearance = _learn_all(data, kept, state, [t.gains[0] for t in appearance])
    all_fits = compare_all(appearance, views, state.turns, centres)
    fits = all_fits.without(out | all_fits.without_information)
    variance = fits.squares.sum(axis=1) / np.maximum(fits.count.sum(axis=1), 1)
    variance = np.maximum(variance, max(_MIN_VARIANCE * np.median(variance), _EXACT))
    by_unknown = data.by_unknown(state)
    equations = centre_equations(*fits.weighted(variance * excess), state.turns, by_unknown)
    step, covariance = solve_centres(equations, data.prior_in(state), state.centres.values[data.free])
    turn_steps = (equations.turn_scores - equations.cross @ step) / equations.turn_information
    remaining = remaining_gradient(fits.normal, fits.gradient, state.turns, by_unknown, step, turn_steps)
    found = state.centres.values.copy()
    found[data.free] += step
    following = replace(state, centres=Centres(found), turns=state.turns + turn_steps)
    if data.axis.estimated:
        following = _with_variances(following, np.diag(covariance), float(np.hypot(*data.axis_in(state).parallax)))
    scatter = displacement_scatter(fits.normal, remaining, variance)
    return Round(appearance, out, variance, excess, scatter, covariance, following, all_fits)


def _with_variances(state: State, error: Floats, slope: float) -> State:
    """Return the state with the variances of heights and leans that follow from their values and errors."""
    size, least = len(state.centres.values), _LEAST_SPREAD_PX / slope
    heights, leans = state.centres.heights, state.centres.leans.ravel()
    return replace(
        state,
        height_variance=_variance(heights, error[heights_of(size)], state.height_variance, least),
        lean_variance=_variance(leans, error[leans_of(size)], state.lean_variance, 2.0 * least / TILE_SIDE_PX),
    )


def _variance(values: Floats, error: Floats, before: float, least: float) -> float:
    """Return the variance of normally distributed values by MacKay's fixed point: Σx² over the number determined.

    The sum is that of a normal distribution with the same median of squares: a tile with a single edge, or half on the
    body, determines its height and lean badly and would make every other tile's as uncertain.
    """
    determined = float((1.0 - error / before).clip(0.0, 1.0).mean())
    variance = float(np.median(values**2)) / _MEDIAN_OF_SQUARES / max(determined, 1.0 / len(values))
    return max(variance, least**2)


def _learn_all(
    data: Data, views: Callable[[int], TileViews], state: State, gains: Sequence[Floats | None] | None = None
) -> list[TileAppearance]:
    """Learn every tile in a state from its views, by its number, with offsets from its centre."""
    parallax, centres, leans = data.axis_in(state).parallax, data.centres(state), state.centres.leans
    gains = [None] * len(data.views) if gains is None else gains

    def learnt(t: int) -> TileAppearance:
        corner = data.tiles.corners[t]
        return learn_tile(corner, TILE_SIDE_PX, views(t), state.turns, centres[t], parallax, leans[t], gains[t])

    return map_in_threads(learnt, range(len(data.views)))


def compare_all(
    appearance: Sequence[TileAppearance], views: Sequence[TileViews], turns: Floats, centres: Floats
) -> TileFit:
    """Compare every tile with every frame: rows are tiles, columns frames."""
    fits = map_in_threads(
        lambda t: compare_tiles(appearance[t], views[t], turns, centres[t][None]), range(len(appearance))
    )
    return TileFit(
        np.stack([f.normal for f in fits]),
        np.stack([f.gradient for f in fits]),
        np.stack([f.squares for f in fits]),
        np.stack([f.count for f in fits]),
        np.stack([f.light for f in fits]),
    )


def _hidden(fits: TileFit) -> NDArray[np.bool_]:
    """Return the views (tiles, frames) with a large misfit: an object in front of a tile must not be learnt."""
    mean_square = fits.squares / np.maximum(fits.count, 1)
    # A tile outside most pictures has no usual misfit; the few views that show it are then marked as hidden.
    usual = np.maximum(np.median(mean_square, axis=1, keepdims=True), _NO_MISFIT)
    # Motion blur and the like affect all tiles alike.
    of_frame = np.maximum(np.median(mean_square / usual, axis=0, keepdims=True), 1.0)
    return np.asarray((mean_square > HIDDEN_MISFIT * of_frame * usual) | covered_views(fits))
