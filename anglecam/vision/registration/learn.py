"""Learning a head from the frames that show it: its looks, the centre it turns about, and how it is turned in each.

All three hang together and are found in turn: looks for given turns, then centre and turns for given looks. A look
that is a little wrong agrees with the turns that made it, so that this goes in ever smaller steps, each about the same
share of the one before: every third time the sum of all that would follow is gone at once (Aitken 1926). How slow it
would have been is what the looks can swallow of an error of the centre, and widens its covariance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats
from anglecam.vision.image.clusters import group_neighbours
from anglecam.vision.image.transforms import rotation
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
from anglecam.vision.registration.tiles import TILE_SIDE_PX, FrameView, MotionPlane, Tiles, view_tiles
from anglecam.vision.registration.turn import BodyAppearance, covered_views, group_scatter

_GROUPS = 6
_ROUNDS = 16
_SETTLED_PX = 0.002
"""Looks, centre and turns are found in turn until the centre moves by less."""
_LOOKS = 3
"""Rounds after which it is settled what is hidden."""
_NUDGE_PX = 0.2
"""By which a settled centre is moved to see how much of it the looks swallow."""
_STRETCH = 1e-3
"""By which settled turns are stretched for the same purpose."""
_LARGEST_SHARE = 0.98
"""Of what they can swallow."""
_SOUND = 0.5
"""Least variance of a tile over the usual one: a smaller one tells of too few views, not of less noise."""
_NOTHING = 1e-9
"""Information of a frame in which every tile is hidden."""
_DEPTH = 0.15
"""Standard deviation of the heights of a head's parts, over their distance from the pivot."""


@dataclass(frozen=True)
class _Prior:
    """What is known of the centres of rotation before the head is looked at: information, 1/px²."""

    pivot: Floats
    height: float


@dataclass(frozen=True)
class _Pose:
    """What is found besides the looks."""

    error: Floats
    """(2,) of the pivot, px."""
    heights: Floats
    """(tiles,) px."""
    turns: Floats
    """(frames,) rad."""

    def moved(self, step: Floats, lever: float) -> _Pose:
        """Go a step, all of it in px."""
        error, heights, turns = np.split(step, [2, 2 + len(self.heights)])
        return _Pose(self.error + error, self.heights + heights, self.turns + turns / lever)

    def step_to(self, other: _Pose, lever: float) -> Floats:
        """Return the step from here to another, all of it in px."""
        parts = other.error - self.error, other.heights - self.heights, lever * (other.turns - self.turns)
        return np.concatenate(parts)


@dataclass(frozen=True)
class _Task:
    """What stays the same from round to round."""

    tiles: Tiles
    views: Sequence[TileViews]
    start_px: Floats
    """(2,) the pivot to begin with."""
    parallax: Floats
    prior: _Prior

    def centres(self, pose: _Pose) -> Floats:
        """Return the centre that each tile turns about, (tiles, 2) px."""
        return self.start_px + pose.error + pose.heights[:, None] * self.parallax

    def seen(self, pose: _Pose) -> list[TileViews]:
        """Return the views from those centres."""
        off = pose.error + (pose.heights - self.tiles.heights)[:, None] * self.parallax
        return [replace(v, offsets=v.offsets - shift) for v, shift in zip(self.views, off, strict=True)]


@dataclass(frozen=True)
class _Round:
    """One round's looks, and where they lead."""

    patches: Sequence[TileAppearance]
    hidden: NDArray[np.bool_]
    """(tiles, frames) views that something covers."""
    variance: Floats
    """(tiles,) of what is left over, grey levels squared."""
    covariance: Floats
    """Of pivot and heights if the looks were known, in units of the pixels' noise."""
    pose: _Pose
    fits: TileFit
    """Of the looks, in the pose that they were learnt for."""


def learn_appearance(
    glimpses: Sequence[FrameView], tiles: Tiles, plane: MotionPlane, pivot: PivotEstimate
) -> BodyAppearance:
    """Learn how the tiles look, where the head turns, and what its turns are, all from the same frames.

    Parameters
    ----------
    glimpses : sequence of Glimpse
        Frames at turns that differ.
    tiles : Tiles
        From `anglecam.vision.registration.tiles.choose_tiles`.
    plane : Plane
        What lies where.
    pivot : Pivot
        Of the reference frame; where the head hardly turns, it is all that is known.

    Returns
    -------
    Look
        In a frame of reference whose pivot is the learnt one.
    """
    start = pivot.centre_px
    lever = float(np.median(np.hypot(*(tiles.corners - start).T)))
    known = np.asarray(np.linalg.inv(pivot.covariance_px2), dtype=float)
    views = [
        view_tiles(c[None], h[None], glimpses, plane, start)[0]
        for c, h in zip(tiles.corners, tiles.heights, strict=True)
    ]
    task = _Task(tiles, views, start, plane.lens.parallax, _Prior(known, 1.0 / (_DEPTH * lever) ** 2))
    pose = _Pose(np.zeros(2), tiles.heights, np.array([g.turn for g in glimpses]))
    patches: Sequence[TileAppearance] = [
        learn_tile(c, TILE_SIDE_PX, v, pose.turns, o)
        for c, v, o in zip(tiles.corners, views, task.centres(pose), strict=True)
    ]
    now = _round(task, pose, patches, None)
    before: Floats | None = None
    for done in range(1, _ROUNDS):
        step = pose.step_to(now.pose, lever)
        if np.hypot(*(task.centres(now.pose) - task.centres(pose)).T).max() < _SETTLED_PX:
            break
        # heights have ways of their own to settle: in a tilted view there is no one share to leap by
        ahead = done > _LOOKS and before is not None and not task.parallax.any()
        pose = pose.moved(step * (_reach(before, step) if ahead and before is not None else 1.0), lever)
        # after a leap two ordinary steps, to see anew where they lead
        before = None if ahead else step
        now = _round(task, pose, now.patches, now.hidden if done >= _LOOKS else None, now.fits)
    swallowed = _swallowed(task, now)
    pose, covariance = now.pose, now.covariance / (1.0 - swallowed)
    fits = _compare_all(now.patches, task.seen(pose), pose.turns, task.centres(pose)).without(now.hidden)
    normal, gradient = fits.weighted(now.variance)
    groups = group_neighbours(tiles.corners, _GROUPS)
    total, freedom = group_scatter(normal, gradient, groups)
    # two witnesses: groups that disagree about the turn, and a head that seems to leave its pivot, if that stands still
    witnesses = [total / max(freedom - len(pose.turns), 1)]
    if glimpses[0].wander_px2 is None:
        witnesses.append(_restlessness(normal.sum(axis=0), gradient.sum(axis=0)))
    birge = max(1.0, float(np.sqrt(max(witnesses))))
    scores = _centre_equations(normal, gradient, pose.turns, task.parallax).scores
    unlike = max(birge**2, _disagreement(now.covariance, scores, groups))
    told = normal[:, :, 0, 0].sum(axis=1)
    return BodyAppearance(
        patches=join_tiles(now.patches),
        heights=pose.heights,
        plane=plane,
        pivot_px=start + pose.error,
        pivot_covariance_px2=unlike * covariance[:2, :2],
        variance=now.variance,
        groups=groups,
        birge=birge,
        absorbed_share=_yielding(task, now),
        middle_px=told @ (tiles.corners + TILE_SIDE_PX / 2) / told.sum(),
    )


def _round(
    task: _Task,
    pose: _Pose,
    patches: Sequence[TileAppearance],
    hidden: NDArray[np.bool_] | None,
    before: TileFit | None = None,
) -> _Round:
    """Learn the looks for a pose, then the pose for those looks."""
    views, centres = task.seen(pose), task.centres(pose)
    before = _compare_all(patches, views, pose.turns, centres) if before is None else before
    out = _hidden(before) if hidden is None else hidden
    patches = [
        learn_tile(p.corners[0], TILE_SIDE_PX, equalise_brightness(v, light).without(o), pose.turns, c, p.gains[0])
        for p, v, c, light, o in zip(patches, views, centres, before.light, out, strict=True)
    ]
    whole = _compare_all(patches, views, pose.turns, centres)
    fits = whole.without(out)
    variance = fits.squares.sum(axis=1) / np.maximum(fits.count.sum(axis=1), 1)
    variance = np.maximum(variance, _SOUND * np.median(variance))
    equations = _centre_equations(*fits.weighted(variance), pose.turns, task.parallax)
    step, covariance = _centres_error(equations, task.prior, pose.error, pose.heights)
    raised = step[2:] if len(step) > 2 else np.zeros(len(pose.heights))
    turn_steps = (equations.turn_pull - equations.crossed @ step) / equations.by_turn
    there = _Pose(pose.error + step[:2], pose.heights + raised, pose.turns + turn_steps)
    return _Round(patches, out, variance, covariance, there, whole)


def _reach(before: Floats, step: Floats) -> float:
    """Tell how many times as far the steps lead in the end: by 1/(1 − r) if each is r times the one before."""
    share = float(before[:2] @ step[:2]) / max(float(before[:2] @ before[:2]), 1e-12)
    return 1.0 / (1.0 - min(share, _LARGEST_SHARE)) if share > 0.0 else 1.0


def _yielding(task: _Task, now: _Round) -> float:
    """Return the share of an error that goes with the turn itself, that the looks adapt to."""
    stretch = _STRETCH * (now.pose.turns - np.median(now.pose.turns))
    after = _round(task, replace(now.pose, turns=now.pose.turns + stretch), now.patches, now.hidden, now.fits)
    return float((after.pose.turns - now.pose.turns) @ stretch / max(float(stretch @ stretch), 1e-18))


def _swallowed(task: _Task, now: _Round) -> float:
    """Return the share of an error of the pivot, in its worst known direction, that the looks adapt to."""
    axis = np.linalg.eigh(now.covariance[:2, :2])[1][:, -1]
    nudged = replace(now.pose, error=now.pose.error + _NUDGE_PX * axis)
    after = _round(task, nudged, now.patches, now.hidden, now.fits)
    left = float((after.pose.error - now.pose.error) @ axis) / _NUDGE_PX
    return float(np.clip(left, 0.0, _LARGEST_SHARE))


def _compare_all(
    patches: Sequence[TileAppearance], views: Sequence[TileViews], turns: Floats, centres: Floats
) -> TileFit:
    """Compare every tile with every frame: rows are tiles, columns frames."""
    fits = [compare_tiles(p, v, turns, c[None]) for p, v, c in zip(patches, views, centres, strict=True)]
    return TileFit(
        np.stack([f.normal for f in fits]),
        np.stack([f.gradient for f in fits]),
        np.stack([f.squares for f in fits]),
        np.stack([f.count for f in fits]),
        np.stack([f.light for f in fits]),
    )


def _hidden(fits: TileFit) -> NDArray[np.bool_]:
    """Tell in which frames a tile is seen badly: what passes before it is not learnt."""
    mean_square = fits.squares / np.maximum(fits.count, 1)
    # a tile that is out of most pictures has no usual misfit; where it is seen, it is judged badly seen
    usual = np.maximum(np.median(mean_square, axis=1, keepdims=True), _NOTHING)
    # motion blur and the like spoil all tiles alike
    spoilt = np.maximum(np.median(mean_square / usual, axis=0, keepdims=True), 1.0)
    return np.asarray((mean_square > HIDDEN_MISFIT * spoilt * usual) | covered_views(fits))


@dataclass(frozen=True)
class _Equations:
    """What tiles say of the errors of pivot and heights (size 2, or 2 + tiles), every frame's turn eliminated."""

    information: Floats
    """(size, size)."""
    scores: Floats
    """(tiles, size)."""
    crossed: Floats
    """(frames, size) what they have in common with each frame's turn."""
    by_turn: Floats
    """(frames,) information about the turn."""
    turn_pull: Floats
    """(frames,) score of the turn."""


def _centre_equations(normal: Floats, gradient: Floats, turns: Floats, parallax: Floats) -> _Equations:
    """Gather what tiles say of the errors of pivot and heights.

    A turned tile seems displaced by t = (1 − R)·(e + p·h). Every frame's turn is free: it is eliminated. Where there
    is no parallax, heights do not count.
    """
    moved = np.eye(2) - rotation(turns)
    place = np.einsum("kai,tkab,kbj->tij", moved, normal[..., 1:, 1:], moved)
    cross = np.einsum("kai,tka->tki", moved, normal[..., 1:, 0])
    pull = np.einsum("kai,tka->ti", moved, gradient[..., 1:])
    by_turn, tiles = np.maximum(normal[..., 0, 0].sum(axis=0), _NOTHING), len(normal)
    size = 2 + (tiles if parallax.any() else 0)
    information, scores, crossed = np.zeros((size, size)), np.zeros((tiles, size)), np.zeros((len(turns), size))
    information[:2, :2], scores[:, :2], crossed[:, :2] = place.sum(axis=0), pull, cross.sum(axis=0)
    if size > 2:
        own = place @ parallax
        information[2:, :2], information[:2, 2:] = own, own.T
        information[2:, 2:] = np.diag(own @ parallax)
        scores[:, 2:] = np.diag(pull @ parallax)
        crossed[:, 2:] = (cross @ parallax).T
    information -= (crossed.T / by_turn) @ crossed
    scores -= (gradient[..., 0] / by_turn) @ crossed
    return _Equations(information, scores, crossed, by_turn, gradient[..., 0].sum(axis=0))


def _centres_error(equations: _Equations, prior: _Prior, so_far: Floats, heights: Floats) -> tuple[Floats, Floats]:
    """Solve for the errors of pivot and heights; return the covariance too, all in units of the pixels' noise."""
    known, right = equations.information.copy(), equations.scores.sum(axis=0)
    known[:2, :2] += prior.pivot
    right[:2] -= prior.pivot @ so_far
    tall = len(known) > 2
    if tall:
        known[2:, 2:] += prior.height * np.eye(len(heights))
        right[2:] -= prior.height * heights
    covariance = np.asarray(np.linalg.inv(known), dtype=float)
    return covariance @ right, covariance


def _disagreement(covariance: Floats, scores: Floats, groups: NDArray[np.intp]) -> float:
    """Ratio of the pivot's variance as groups of tiles disagree about it to what noise alone makes it.

    The cluster-robust sandwich (Liang & Zeger 1986), a cluster a group.
    """
    names = np.unique(groups)
    told = np.stack([scores[groups == group].sum(axis=0) for group in names]) @ covariance
    variance = float((told[:, :2] ** 2).sum()) * len(names) / max(len(names) - 2, 1)
    return variance / float(np.trace(covariance[:2, :2]))


def _restlessness(normal: Floats, gradient: Floats) -> float:
    """Mean square of the displacement that a head on a fixed pivot cannot have, in units of its noise."""
    seen = normal[:, 0, 0] > _NOTHING
    normal, gradient = normal[seen], gradient[seen]
    place = normal[:, 1:, 1:] - normal[:, 1:, :1] * normal[:, :1, 1:] / normal[:, :1, :1]
    shift = gradient[:, 1:] - normal[:, 1:, 0] * (gradient[:, :1] / normal[:, :1, 0])
    return float(np.einsum("ni,nij,nj->n", shift, np.linalg.pinv(place, hermitian=True), shift).mean() / 2.0)
