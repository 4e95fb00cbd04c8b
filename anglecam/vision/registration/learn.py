"""Learn the body from the frames that show it: its appearance, its centre of rotation, and its angle in each frame.

The three depend on one another and are found alternately: the appearance for given angles, then centre and angles for a
given appearance. An appearance with a small error agrees with the angles from which it was learnt, so the steps shrink
slowly, each error by the share of it that the appearance absorbs. After the first rounds the steps are therefore
extended by Anderson's acceleration (Anderson 1965). The share absorbed of an error of the centre is measured at the end
by displacing the converged centre, and enlarges the centre's covariance.

Parts of the body at different heights rotate about different image points. The heights are drawn from a normal
distribution, whose variance is estimated from the heights themselves (MacKay 1992): a flat body thereby keeps a common
centre.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats
from anglecam.vision.image.clusters import group_neighbours
from anglecam.vision.pivot.estimate import PivotEstimate
from anglecam.vision.registration.appearance import (
    HIDDEN_MISFIT,
    TileAppearance,
    TileFit,
    TileViews,
    compare_tiles,
    equalise_brightness,
    join_tiles,
    learn_tile,
)
from anglecam.vision.registration.centre_equations import (
    DIRECTION,
    PIVOT,
    Centres,
    centre_equations,
    disagreement_of_groups,
    displacement_scatter,
    effective_centre,
    excess_displacement,
    heights_of,
    leans_of,
    remaining_gradient,
    solve_centres,
)
from anglecam.vision.registration.tiles import TILE_SIDE_PX, AxisView, FrameView, MotionPlane, Tiles, view_tiles
from anglecam.vision.registration.turn import BodyAppearance, covered_views, group_scatter

_GROUPS = 6
"""Groups of neighbouring tiles."""
_MAX_ROUNDS = 16
_SETTLED_PX = 0.002
"""Change of the centres of rotation below which the iteration ends, px."""
_HIDDEN_ROUNDS = 3
"""Rounds after which the set of hidden views is no longer changed."""
_WEIGHING_ROUNDS = 6
"""Rounds after which the tiles' weights are no longer changed."""
_NUDGE_PX = 0.2
"""Displacement of a converged centre by which its absorbed share is measured, px."""
_STRETCH = 1e-3
"""Relative stretch of converged angles by which their absorbed share is measured."""
_MAX_ABSORBED = 0.98
"""Largest share of an error that the appearance is assumed to absorb."""
_MIN_VARIANCE = 0.5
"""Least variance of a tile relative to the median. A smaller variance results from too few views, not from less
noise."""
_NO_MISFIT = 1e-9
"""Replaces the usual misfit, zero, of a tile that is outside most pictures."""
_DEPTH = 0.3
"""Standard deviation of the heights of a body's parts, and of mark and marker from them, relative to the distance from
the pivot: the initial value for the parts, the only one for mark and marker, whose height nothing shows."""
_LEAN = 0.3
"""Initial standard deviation of the gradient of a body's height."""
_MEDIAN_OF_SQUARES = 0.455
"""Median of the square of a standard normal variable."""
_LEAST_SPREAD_PX = 0.003
"""Least standard deviation of the centres of rotation that heights cause: a body is never known to be flatter, px."""
_LEAST_SHARE = 1e-3
"""Singular values of the steps' differences below this share of the largest are noise."""
_MEMORY = 4
"""Rounds that the acceleration remembers."""


@dataclass(frozen=True)
class _State:
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

    def moved(self, step: Floats, following: _State) -> _State:
        """Return the state after a step as from `step_to`, with the distributions of another state."""
        centres, turns = np.split(step / self.scale, [len(self.centres.values)])
        return replace(following, centres=Centres(self.centres.values + centres), turns=self.turns + turns)

    def step_to(self, other: _State) -> Floats:
        """Return the step from this state to another, all components in px."""
        step = other.centres.values - self.centres.values
        return np.asarray(np.concatenate([step, other.turns - self.turns]) * self.scale)


@dataclass(frozen=True)
class _Data:
    """Everything that stays the same from round to round."""

    tiles: Tiles
    views: Sequence[TileViews]
    """One for each tile."""
    start_px: Floats
    """(2,) the initial pivot."""
    axis: AxisView
    """As initially assumed."""
    prior: Floats
    """(3, 3) prior information on pivot and direction, 1/px² and 1/rad²."""

    def axis_in(self, state: _State) -> AxisView:
        """Return how the axis is seen in a state."""
        return self.axis.turned(state.centres.direction)

    def centres(self, state: _State) -> Floats:
        """Return the centre of rotation of each tile, (tiles, 2) px."""
        along = state.centres.heights[:, None] * self.axis_in(state).parallax
        return np.asarray(self.start_px + state.centres.pivot + along)

    def seen(self, state: _State) -> list[TileViews]:
        """Return the views with offsets from those centres."""
        off = self.centres(state) - (self.start_px + self.tiles.heights[:, None] * self.axis.parallax)
        return [replace(v, offsets=v.offsets - shift) for v, shift in zip(self.views, off, strict=True)]

    def prior_in(self, state: _State) -> Floats:
        """Return the prior information on all that determines the centres, (3 + 3·tiles, 3 + 3·tiles)."""
        size = len(state.centres.values)
        whole = np.eye(size)
        whole[:3, :3] = self.prior
        whole[heights_of(size), heights_of(size)] /= state.height_variance
        whole[leans_of(size), leans_of(size)] /= state.lean_variance
        return whole


@dataclass(frozen=True)
class _Round:
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
    """Of pivot and heights for a known appearance, in units of the pixels' noise."""
    state: _State
    fits: TileFit
    """Of the appearance, in the state for which it was learnt."""


def learn_appearance(
    frames: Sequence[FrameView], tiles: Tiles, plane: MotionPlane, pivot: PivotEstimate
) -> BodyAppearance:
    """Learn the tiles' appearance, the centre of rotation and the angles, all from the same frames.

    Parameters
    ----------
    frames : sequence of FrameView
        Frames at different angles.
    tiles : Tiles
        From `anglecam.vision.registration.tiles.choose_tiles`.
    plane : MotionPlane
        Place of each pixel.
    pivot : PivotEstimate
        Prior of the pivot in the reference frame. Where the body hardly rotates, the data add no information to it.

    Returns
    -------
    BodyAppearance
        In a frame of reference whose pivot is the learnt one.
    """
    start = pivot.centre_px
    lever = float(np.median(np.hypot(*(tiles.corners - start).T)))
    prior = np.zeros((3, 3))
    prior[PIVOT, PIVOT] = np.linalg.inv(covariance_at_unknown_height(pivot, plane, lever))
    prior[DIRECTION, DIRECTION] = plane.axis.direction_sigma**-2
    views = [
        view_tiles(c[None], h[None], frames, plane, start)[0] for c, h in zip(tiles.corners, tiles.heights, strict=True)
    ]
    data = _Data(tiles, views, start, plane.axis, prior)
    last = _iterate(data, _first_state(frames, tiles, plane, lever))
    state, covariance = last.state, last.covariance / (1.0 - _absorbed_of_pivot(data, last))
    heights, axis = state.centres.heights, data.axis_in(state)
    fits = _compare_all(last.appearance, data.seen(state), state.turns, data.centres(state)).without(last.hidden)
    normal, gradient = fits.weighted(last.variance * last.excess)
    groups = group_neighbours(tiles.corners, _GROUPS)
    total, freedom = group_scatter(normal, gradient, groups)
    # Two estimates of the Birge ratio: disagreement of groups about the angle and, where the camera does not move, the
    # displacement that a body on a fixed pivot cannot have.
    estimates = [total / max(freedom - len(state.turns), 1)]
    if frames[0].pivot_covariance_px2 is None:
        estimates.append(excess_displacement(normal.sum(axis=0), gradient.sum(axis=0)))
    birge = max(1.0, float(np.sqrt(max(estimates))))
    scores = centre_equations(normal, gradient, state.turns, axis, heights).scores
    acting = effective_centre(normal, axis, heights)
    variance_ratio = max(birge**2, disagreement_of_groups(last.covariance, scores, groups, acting))
    information = normal[:, :, 0, 0].sum(axis=1)
    return BodyAppearance(
        tiles=join_tiles(last.appearance),
        heights=heights,
        plane=replace(plane, axis=axis),
        pivot_px=start + state.centres.pivot,
        pivot_covariance_px2=variance_ratio * covariance[PIVOT, PIVOT],
        centre_covariance_px2=variance_ratio * acting @ covariance @ acting.T,
        variance=last.variance,
        excess=last.excess,
        groups=groups,
        birge=birge,
        absorbed_share=_absorbed_of_turns(data, last),
        middle_px=information @ (tiles.corners + TILE_SIDE_PX / 2) / information.sum(),
    )


def covariance_at_unknown_height(pivot: PivotEstimate, plane: MotionPlane, lever_px: float) -> Floats:
    """Return the covariance (2, 2) of a pivot that was found at another height than that of the body, px²."""
    along = _DEPTH * lever_px * plane.axis.parallax
    return np.asarray(pivot.covariance_px2 + np.outer(along, along))


def _first_state(frames: Sequence[FrameView], tiles: Tiles, plane: MotionPlane, lever: float) -> _State:
    """Return the state before anything is learnt."""
    scatter, tiles_in_all = _DEPTH * lever, len(tiles.heights)
    across = scatter * float(np.hypot(*plane.axis.parallax))
    bent = TILE_SIDE_PX / 2 * float(np.hypot(*plane.axis.parallax))
    scale = np.repeat([1.0, across, 1.0, bent, lever], [2, 1, tiles_in_all, 2 * tiles_in_all, len(frames)])
    centres = Centres(np.concatenate([np.zeros(3), tiles.heights, np.zeros(2 * tiles_in_all)]))
    return _State(centres, np.array([f.turn for f in frames]), scatter**2, _LEAN**2, scale)


def _iterate(data: _Data, state: _State) -> _Round:
    """Alternate between appearance and state until the centres of rotation settle; return the last round."""
    appearance = _learn_all(data, data.views, state)
    now = _round(data, state, appearance, None, np.ones(len(appearance)))
    states: list[Floats] = []
    steps: list[Floats] = []
    origin = state
    for done in range(1, _MAX_ROUNDS):
        if np.hypot(*(data.centres(now.state) - data.centres(state)).T).max() < _SETTLED_PX:
            break
        states, steps = [*states, origin.step_to(state)], [*steps, state.step_to(now.state)]
        if done <= _HIDDEN_ROUNDS:
            states, steps = states[-1:], steps[-1:]
        step = _accelerated(states[-_MEMORY:], steps[-_MEMORY:])
        state = state.moved(step, now.state)
        hidden = now.hidden if done >= _HIDDEN_ROUNDS else None
        excess = np.maximum(now.scatter, 1.0) if done < _WEIGHING_ROUNDS else now.excess
        now = _round(data, state, now.appearance, hidden, excess, now.fits)
    return now


def _accelerated(states: Sequence[Floats], steps: Sequence[Floats]) -> Floats:
    """Return Anderson's step from the last state: the one that would vanish if the steps were linear in the states."""
    last = steps[-1]
    if len(steps) == 1:
        return last
    of_steps, of_states = np.diff(steps, axis=0).T, np.diff(states, axis=0).T
    share = np.linalg.lstsq(of_steps, last, rcond=_LEAST_SHARE)[0]
    whole = last - (of_states + of_steps) @ share
    most = float(np.linalg.norm(last)) / (1.0 - _MAX_ABSORBED)
    return np.asarray(whole * min(1.0, most / max(float(np.linalg.norm(whole)), 1e-12)))


def _round(
    data: _Data,
    state: _State,
    appearance: Sequence[TileAppearance],
    hidden: NDArray[np.bool_] | None,
    excess: Floats,
    before: TileFit | None = None,
) -> _Round:
    """Learn the appearance for a state, then the state for that appearance."""
    views, centres = data.seen(state), data.centres(state)
    before = _compare_all(appearance, views, state.turns, centres) if before is None else before
    out = _hidden(before) if hidden is None else hidden
    kept = [equalise_brightness(v, light).without(o) for v, light, o in zip(views, before.light, out, strict=True)]
    appearance = _learn_all(data, kept, state, [t.gains[0] for t in appearance])
    all_fits = _compare_all(appearance, views, state.turns, centres)
    fits = all_fits.without(out)
    variance = fits.squares.sum(axis=1) / np.maximum(fits.count.sum(axis=1), 1)
    variance = np.maximum(variance, _MIN_VARIANCE * np.median(variance))
    axis = data.axis_in(state)
    axis = data.axis_in(state)
    equations = centre_equations(*fits.weighted(variance * excess), state.turns, axis, state.centres.heights)
    step, covariance = solve_centres(equations, data.prior_in(state), state.centres.values)
    found = Centres(state.centres.values + step)
    turn_steps = (equations.turn_scores - equations.cross @ step) / equations.turn_information
    before_step = fits.normal, fits.gradient, state.turns, axis, state.centres.heights
    remaining = remaining_gradient(*before_step, step, turn_steps)
    error = np.diag(covariance)
    least = _LEAST_SPREAD_PX / float(np.hypot(*axis.parallax))
    following = replace(
        state,
        centres=found,
        turns=state.turns + turn_steps,
        height_variance=_variance(found.heights, error[heights_of(len(error))], state.height_variance, least),
        lean_variance=_variance(
            found.leans.ravel(), error[leans_of(len(error))], state.lean_variance, 2.0 * least / TILE_SIDE_PX
        ),
    )
    scatter = displacement_scatter(fits.normal, remaining, variance)
    return _Round(appearance, out, variance, excess, scatter, covariance, following, all_fits)


def _variance(values: Floats, error: Floats, before: float, least: float) -> float:
    """Return the variance of normally distributed values by MacKay's fixed point: Σx² over the number determined.

    The sum is that of a normal distribution with the same median of squares: a tile with a single edge, or half on the
    body, determines its height and lean badly and would make every other tile's as uncertain.
    """
    determined = float((1.0 - error / before).clip(0.0, 1.0).mean())
    variance = float(np.median(values**2)) / _MEDIAN_OF_SQUARES / max(determined, 1.0 / len(values))
    return max(variance, least**2)


def _learn_all(
    data: _Data, views: Sequence[TileViews], state: _State, gains: Sequence[Floats | None] | None = None
) -> list[TileAppearance]:
    """Learn every tile in a state from views with offsets from its centres."""
    parallax, gains = data.axis_in(state).parallax, [None] * len(views) if gains is None else gains
    each = zip(data.tiles.corners, views, data.centres(state), state.centres.leans, gains, strict=True)
    return [learn_tile(c, TILE_SIDE_PX, v, state.turns, o, parallax, lean, g) for c, v, o, lean, g in each]


def _absorbed_of_turns(data: _Data, now: _Round) -> float:
    """Return the share of an error of the angles, proportional to the angle, that the appearance absorbs."""
    stretch = _STRETCH * (now.state.turns - np.median(now.state.turns))
    stretched = replace(now.state, turns=now.state.turns + stretch)
    after = _round(data, stretched, now.appearance, now.hidden, now.excess, now.fits)
    return float((after.state.turns - now.state.turns) @ stretch / max(float(stretch @ stretch), 1e-18))


def _absorbed_of_pivot(data: _Data, now: _Round) -> float:
    """Return the share of an error of the pivot, in its least certain direction, that the appearance absorbs."""
    axis = np.linalg.eigh(now.covariance[PIVOT, PIVOT])[1][:, -1]
    nudge = np.zeros(len(now.state.centres.values))
    nudge[PIVOT] = _NUDGE_PX * axis
    nudged = replace(now.state, centres=Centres(now.state.centres.values + nudge))
    after = _round(data, nudged, now.appearance, now.hidden, now.excess, now.fits)
    remaining = float((after.state.centres.pivot - now.state.centres.pivot) @ axis) / _NUDGE_PX
    return float(np.clip(remaining, 0.0, _MAX_ABSORBED))


def _compare_all(
    appearance: Sequence[TileAppearance], views: Sequence[TileViews], turns: Floats, centres: Floats
) -> TileFit:
    """Compare every tile with every frame: rows are tiles, columns frames."""
    fits = [compare_tiles(t, v, turns, c[None]) for t, v, c in zip(appearance, views, centres, strict=True)]
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
