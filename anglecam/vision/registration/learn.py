"""Learn the body from the frames that show it: its appearance, its centre of rotation, and its angle in each frame.

The three depend on one another and are found alternately (`anglecam.vision.registration.alternation`). The share of an
error of the centre that the appearance absorbs is measured at the end by displacing the converged centre, and that of
an error of the angles by stretching them. The larger share enlarges the centre's covariance.

The simple model is first: all parts rotate about one centre. Parts at different depths do not, in perspective. Where
the tiles show this (`anglecam.vision.registration.own_centres`), the body is learnt again with a height and a slope for
every tile. The heights are drawn from a normal distribution, whose variance is estimated from the heights themselves
(MacKay 1992).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats
from anglecam.vision.image.clusters import group_neighbours
from anglecam.vision.image.transforms import rotation
from anglecam.vision.pivot.estimate import PivotEstimate
from anglecam.vision.registration.alternation import Data, Round, State, alternate, compare_all, one_round
from anglecam.vision.registration.appearance import join_tiles
from anglecam.vision.registration.axis_view import axis_in_perspective
from anglecam.vision.registration.centre_equations import (
    DIRECTION,
    NO_INFORMATION,
    PIVOT,
    Centres,
    centre_equations,
    disagreement_of_groups,
    effective_centre,
    group_scatter,
)
from anglecam.vision.registration.own_centres import have_own_centres
from anglecam.vision.registration.pivot_wander import excess_displacement, frame_displacements, pivot_wander
from anglecam.vision.registration.tile_choice import choose_tiles
from anglecam.vision.registration.tiles import (
    TILE_SIDE_PX,
    FrameView,
    MotionPlane,
    Tiles,
    collect_tiles,
)
from anglecam.vision.registration.turn import BodyAppearance

_FEWEST_TILES = 3
_GROUPS = 6
"""Groups of neighbouring tiles."""
_NUDGE_PX = 0.2
"""Displacement of a converged centre by which its absorbed share is measured, px."""
_STRETCH = 1e-3
"""Relative stretch of converged angles by which their absorbed share is measured."""
_LEAST_SEEN = 0.5
"""Share of the tiles' views, over all frames, that are not taken for hidden. It was 0.90 and more in twenty films of a
head, one of them behind a curtain for a sixth of the time, and 0.15 to 0.58 in nine of a plain plate."""
_DEPTH = 0.15
"""Standard deviation of the heights of a body's parts, relative to their distance from the pivot, in a tilted view."""
_DEPTH_SEEN = 0.3
"""The same where tiles have centres of their own: an initial value, from which the estimated one follows."""
_LEAN = 0.3
"""Initial standard deviation of the gradient of a body's height."""


def learn_body(
    frames: Sequence[FrameView], stack: Sequence[FrameView], plane: MotionPlane, pivot: PivotEstimate, noise: float
) -> BodyAppearance | None:
    """Choose the body's tiles and learn them, with a common centre of rotation or, on evidence, with heights.

    Parameters
    ----------
    frames : sequence of FrameView
        Frames at different angles.
    stack : sequence of FrameView
        Those of them that are superposed to find the rigid tiles.
    plane : MotionPlane
        Place of each pixel.
    pivot : PivotEstimate
        Prior of the pivot in the reference frame. Where the body hardly rotates, the data add no information to it.
    noise : float
        Standard deviation of the pixels, grey levels.

    Returns
    -------
    BodyAppearance or None
        In a frame of reference whose pivot is the learnt one; ``None`` where too little is rigid and has edges.
    """
    tiles = choose_tiles(stack, plane, pivot.centre_px, noise)
    if len(tiles.corners) < _FEWEST_TILES:
        return None
    moving = frames[0].pivot_covariance_px2 is not None
    data, last = _learn(frames, tiles, plane, pivot)
    if not moving:
        data, last = _where_it_wandered(data, last)
    end = _at_the_end(data, last)
    if not plane.axis.parallax.any():
        height, width = frames[0].image.shape[:2]
        deep = replace(plane, axis=axis_in_perspective(plane.lens, (width, height), pivot.centre_px))
        arms = tiles.corners + TILE_SIDE_PX / 2 - data.centres(last.state)
        if have_own_centres(*end, last.state.turns, arms, deep.axis.parallax):
            tiles = choose_tiles(stack, deep, pivot.centre_px, noise)
            if len(tiles.corners) >= _FEWEST_TILES:
                plane, (data, last) = deep, _learn(frames, tiles, deep, pivot, last.state, data.wander_px)
                end = _at_the_end(data, last)
    if not _is_seen(end):
        return None
    return _body(data, last, end, plane, moving)


def _learn(
    frames: Sequence[FrameView],
    tiles: Tiles,
    plane: MotionPlane,
    pivot: PivotEstimate,
    flat: State | None = None,
    wander_px: Floats | float = 0.0,
) -> tuple[Data, Round]:
    """Learn with the unknowns that the view of the axis leaves free, from the state of a flat body if there is one.

    Heights that grow with the distance from the pivot look nearly like another scale of the angles together with
    another pivot. They would keep an error of the mark's pivot, which a flat body does not.
    """
    start = pivot.centre_px
    prior = np.eye(3)
    prior[PIVOT, PIVOT] = np.linalg.inv(pivot.covariance_px2)
    if plane.axis.estimated:
        prior[DIRECTION, DIRECTION] = plane.axis.direction_sigma**-2
    views = collect_tiles(tiles.corners, tiles.heights, frames, plane, start)
    data = Data(tiles, views, start, plane.axis, prior, np.broadcast_to(wander_px, (len(frames), 2)))
    first = _first_state(frames, tiles, plane, start)
    if flat is not None:
        values = first.centres.values.copy()
        values[PIVOT] = flat.centres.pivot
        first = replace(first, centres=Centres(values), turns=flat.turns)
    return data, alternate(data, first)


def _where_it_wandered(data: Data, last: Round) -> tuple[Data, Round]:
    """Learn once more, each frame with its pivot where it was seen, if the pivot wanders.

    What is learnt from displaced frames absorbs a quarter of the displacement: of 0.20 px, 0.14 to 0.17 px were
    found in drawn plates, and 0.21 to 0.24 px after it. Third and fourth times make it larger still.
    """
    normal, gradient = _at_the_end(data, last)
    whole = _of_whole_body(data, last.state, normal, gradient)
    birge2, _ = _birge_ratio(data, normal, gradient)
    wander = pivot_wander(*whole, birge2)
    if wander == 0.0:
        return data, last
    in_body = frame_displacements(*whole, birge2, wander)
    placed = replace(data, wander_px=-np.einsum("nij,nj->ni", rotation(last.state.turns), in_body))
    return placed, alternate(placed, last.state)


def _first_state(frames: Sequence[FrameView], tiles: Tiles, plane: MotionPlane, start_px: Floats) -> State:
    """Return the state before anything is learnt."""
    lever, tiles_in_all = float(np.median(np.hypot(*(tiles.corners - start_px).T))), len(tiles.heights)
    scatter, slope = (_DEPTH_SEEN if plane.axis.estimated else _DEPTH) * lever, float(np.hypot(*plane.axis.parallax))
    across, bent = (scatter * slope, TILE_SIDE_PX / 2 * slope) if plane.axis.estimated else (1.0, 1.0)
    scale = np.repeat([1.0, across, 1.0, bent, lever], [2, 1, tiles_in_all, 2 * tiles_in_all, len(frames)])
    centres = Centres(np.concatenate([np.zeros(3), tiles.heights, np.zeros(2 * tiles_in_all)]))
    return State(centres, np.array([f.turn for f in frames]), scatter**2, _LEAN**2, scale)


def _at_the_end(data: Data, last: Round) -> tuple[Floats, Floats]:
    """Return normal matrices and gradients, divided by the variances, in the state that the last round found."""
    fits = compare_all(last.appearance, data.seen(last.state), last.state.turns, data.centres(last.state))
    return fits.without(last.hidden | fits.without_information).weighted(last.variance * last.excess)


def _is_seen(end: tuple[Floats, Floats]) -> bool:
    """Return whether most views of the tiles show what was learnt; else too little of it is one rigid body."""
    return bool((end[0][..., 0, 0] > NO_INFORMATION).mean() >= _LEAST_SEEN)


def _body(data: Data, last: Round, end: tuple[Floats, Floats], plane: MotionPlane, moving: bool) -> BodyAppearance:
    """Return the body of the last round with its uncertainties."""
    normal, gradient = end
    absorbed_of_turns = _absorbed_of_turns(data, last)
    absorbed = float(np.clip(max(absorbed_of_turns, _absorbed_of_pivot(data, last)), 0.0, 1.0))
    state = last.state
    # what the appearance absorbs is no information; where it absorbs all, the centre is known as it was before
    information = (1.0 - absorbed) * np.linalg.inv(last.covariance) + absorbed * data.prior_in(state)
    covariance = np.asarray(np.linalg.inv(information), dtype=float)
    # Two estimates of the Birge ratio: disagreement of groups about the angle and, where neither camera nor pivot
    # moves, the displacement that a body on a fixed pivot cannot have.
    birge2, groups = _birge_ratio(data, normal, gradient)
    wander = 0.0
    if not moving:
        whole = _of_whole_body(data, state, normal, gradient)
        wander = pivot_wander(*whole, birge2)
        birge2 = birge2 if wander else max(birge2, excess_displacement(*whole))
    birge = float(np.sqrt(birge2))
    by_unknown = data.by_unknown(state)
    scores = centre_equations(normal, gradient, state.turns, by_unknown).scores
    acting = effective_centre(normal, by_unknown)
    variance_ratio = max(birge**2, disagreement_of_groups(last.covariance, scores, groups, acting))
    information = normal[:, :, 0, 0].sum(axis=1)
    middles = data.tiles.corners + TILE_SIDE_PX / 2
    middle = information @ middles / information.sum()
    return BodyAppearance(
        tiles=join_tiles(last.appearance),
        heights=state.centres.heights,
        plane=replace(plane, axis=data.axis_in(state)),
        pivot_px=data.start_px + state.centres.pivot,
        pivot_covariance_px2=variance_ratio * covariance[PIVOT, PIVOT],
        centre_covariance_px2=variance_ratio * acting @ covariance @ acting.T,
        variance=last.variance,
        excess=last.excess,
        groups=groups,
        birge=birge,
        wander_px=wander,
        absorbed_share=absorbed_of_turns,
        middle_px=middle,
        extent_px=float(np.sqrt(information @ ((middles - middle) ** 2).sum(axis=1) / information.sum())),
    )


def _birge_ratio(data: Data, normal: Floats, gradient: Floats) -> tuple[float, NDArray[np.intp]]:
    """Return the square of the groups' disagreement about the angle over that expected from noise, and the groups."""
    groups = group_neighbours(data.tiles.corners, _GROUPS)
    total, freedom = group_scatter(normal, gradient, groups)
    return max(1.0, total / max(freedom - normal.shape[1], 1)), groups


def _of_whole_body(data: Data, state: State, normal: Floats, gradient: Floats) -> tuple[Floats, Floats]:
    """Return the sums over tiles of normal matrix and gradient, as if no wander of the pivot were taken out."""
    whole, score = normal.sum(axis=0)[:, :3, :3], gradient.sum(axis=0)[:, :3]
    taken_out = np.einsum("nji,nj->ni", rotation(state.turns), data.wander_px)
    return whole, score - np.einsum("nij,nj->ni", whole[:, :, 1:], taken_out)


def _absorbed_of_turns(data: Data, now: Round) -> float:
    """Return the share of an error of the angles, proportional to the angle, that the appearance absorbs."""
    stretch = _STRETCH * (now.state.turns - np.median(now.state.turns))
    stretched = replace(now.state, turns=now.state.turns + stretch)
    # a body whose heights have not quite settled moves without the stretch, too
    with_it, without = (
        one_round(data, state, now.appearance, now.hidden, now.excess, now.fits).state
        for state in (stretched, now.state)
    )
    return float((with_it.turns - without.turns) @ stretch / max(float(stretch @ stretch), 1e-18))


def _absorbed_of_pivot(data: Data, now: Round) -> float:
    """Return the share of an error of the pivot, in its least certain direction, that the appearance absorbs."""
    axis = np.linalg.eigh(now.covariance[PIVOT, PIVOT])[1][:, -1]
    nudge = np.zeros(len(now.state.centres.values))
    nudge[PIVOT] = _NUDGE_PX * axis
    nudged = replace(now.state, centres=Centres(now.state.centres.values + nudge))
    after = one_round(data, nudged, now.appearance, now.hidden, now.excess, now.fits)
    return float((after.state.centres.pivot - now.state.centres.pivot) @ axis) / _NUDGE_PX
