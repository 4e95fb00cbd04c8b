"""The head's turn from all that is rigid on it: many small patches, each learnt from the clip itself.

A coarse angle, good to a few hundredths of a pixel, lets the frames be turned back onto one another. What then stands
still is the head; where it has edges, it has information. The best tiles are learnt (`anglecam.vision.patch`), and each
frame's turn is the one at which they fit best, by Gauss and Newton, weighted by their noise.

What the tiles say of one turn scatters more than their pixels' noise alone would make it: codecs err in blocks, light
is not quite a slow gain. That scatter between tiles, the Birge ratio (Birge 1932), multiplies the uncertainty. It does
not show what errs alike on the whole head: where a codec copies pixels from the frame before, the copy hides a turn
that is too small for its quantiser.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.vq import kmeans2

from anglecam.vision.patch import Fit, Patches, Views, compare, learn_patch, levelled
from anglecam.vision.pivot import Pivot
from anglecam.vision.tiles import SIDE_PX, Glimpse, Image, Plane, Tiles, look_at

Floats = NDArray[np.float64]

GROUPS = 6
_ROUNDS = 12
_SETTLED_PX = 0.003
"""The look and the pivot are learnt in turn until the pivot moves by less."""
_STEPS = 3
"""Of Gauss and Newton, at most."""
_SETTLED = 1e-6
"""A step below this ends them, rad."""
_TRUST = 3.0
"""Degrees of freedom that the whole clip's scatter has against a single frame's."""
_HIDDEN = 3.0
"""Times its usual mean square that a tile misfits in a frame where something hides it."""
_DIMMED = 0.5
"""Departure of a view's contrast from the look's that no light makes."""
_BETTER = 0.6
"""Misfit of another turn over that of the guess below which the guess is wrong."""
_SOUND = 0.5
"""Least variance of a tile over the usual one: a smaller one tells of too few views, not of less noise."""
_LOOKS = 3
"""Rounds after which it is settled what is hidden."""
_NOTHING = 1e-9
"""Information of a frame in which every tile is hidden."""
_DEPTH = 0.15
"""Standard deviation of the heights of a head's parts, over their distance from the pivot."""
_COPY = 0.13
"""What a codec's copy hides, as a share of the turn whose change of the picture equals the tiles' misfit: films with
known angles, encoded by x264 at crf 12 to 30, presets ultrafast to medium, have 0.10 to 0.16."""


@dataclass(frozen=True)
class Look:
    """The head as it was learnt."""

    patches: Patches
    heights: Floats
    """(tiles,) px."""
    plane: Plane
    pivot_px: Floats
    """(2,) centre of rotation in the reference frame, px."""
    pivot_covariance_px2: Floats
    """(2, 2) px²."""
    variance: Floats
    """(tiles,) mean square of what each tile leaves over, grey levels squared."""
    groups: NDArray[np.intp]
    """(tiles,) which of them lie together."""
    birge: float
    """Scatter between groups over what the pixels' noise would make it; at least 1."""
    middle_px: Floats
    """(2,) of the tiles, each by its information, in the reference frame, px."""

    def row_of_middle(self, glimpse: Glimpse) -> float:
        """Return the row of the picture in which a frame shows the middle."""
        c, s = np.cos(glimpse.turn), np.sin(glimpse.turn)
        arm = (self.middle_px - self.pivot_px) @ np.array([[c, -s], [s, c]])
        return float(self.plane.lens.distort(glimpse.pivot_px + arm)[1])


@dataclass(frozen=True)
class Turn:
    """One frame's turn."""

    turn: float
    """rad; NaN where too little of the head is to be seen."""
    noise: float
    """Standard uncertainty from the pixels' noise, rad; another frame's is its own."""
    pose: float
    """Standard uncertainty from what goes with the place on the pixel grid, rad: codec, light; the same at the same."""
    pull: Floats
    """(2,) change of the turn with an error of the pivot, rad/px."""


@dataclass(frozen=True)
class _Prior:
    """What is known of the centres of rotation before the head is looked at: information, 1/px²."""

    pivot: Floats
    height: float


LOST = Turn(np.nan, np.nan, np.nan, np.full(2, np.nan))


def learn(glimpses: Sequence[Glimpse], tiles: Tiles, plane: Plane, pivot: Pivot) -> Look:
    """Learn how the tiles look, where the head turns, and what its turns are, all from the same frames.

    Parameters
    ----------
    glimpses : sequence of Glimpse
        Frames at turns that differ.
    tiles : Tiles
        From `anglecam.vision.tiles.choose_tiles`.
    plane : Plane
        What lies where.
    pivot : Pivot
        Of the reference frame; where the head hardly turns, it is all that is known.

    Returns
    -------
    Look
        In a frame of reference whose pivot is the learnt one.
    """
    turns = np.array([g.turn for g in glimpses])
    start, heights, parallax = pivot.centre_px, tiles.heights.copy(), plane.lens.parallax
    error, hidden = np.zeros(2), np.zeros((len(heights), len(turns)), bool)
    tall = _DEPTH * float(np.median(np.hypot(*(tiles.corners - start).T)))
    prior = _Prior(np.asarray(np.linalg.inv(pivot.covariance_px2), dtype=float), 1.0 / tall**2)
    views = [
        look_at(c[None], h[None], glimpses, plane, start)[0] for c, h in zip(tiles.corners, tiles.heights, strict=True)
    ]

    def centres() -> Floats:
        return start + error + heights[:, None] * parallax

    patches: list[Patches] = [
        learn_patch(c, SIDE_PX, v, turns, o) for c, v, o in zip(tiles.corners, views, centres(), strict=True)
    ]
    for done in range(_ROUNDS):
        fits = _compare_all(patches, views, turns, centres())
        hidden = _hidden(fits) if done < _LOOKS else hidden
        patches = [
            learn_patch(p.corners[0], SIDE_PX, levelled(v, light).without(out), turns, o, p.gains[0])
            for p, v, o, light, out in zip(patches, views, centres(), fits.light, hidden, strict=True)
        ]
        fits = _compare_all(patches, views, turns, centres()).without(hidden)
        variance = fits.squares.sum(axis=1) / np.maximum(fits.count.sum(axis=1), 1)
        variance = np.maximum(variance, _SOUND * np.median(variance))
        equations = _centre_equations(*fits.weighted(variance), turns, parallax)
        moved, raised, covariance = _centres_error(*equations, prior, error, heights)
        error, heights = error + moved, heights + raised
        shifts = moved + raised[:, None] * parallax
        views = [replace(v, offsets=v.offsets - shift) for v, shift in zip(views, shifts, strict=True)]
        normal, gradient = _compare_all(patches, views, turns, centres()).without(hidden).weighted(variance)
        turns = turns + gradient.sum(axis=0)[:, 0] / np.maximum(normal.sum(axis=0)[:, 0, 0], _NOTHING)
        if np.hypot(*shifts.T).max() < _SETTLED_PX:
            break
    normal, gradient = _compare_all(patches, views, turns, centres()).without(hidden).weighted(variance)
    groups = _groups(tiles.corners)
    total, freedom = _scatter(normal, gradient, groups)
    # two witnesses: groups that disagree about the turn, and a head that seems to leave its pivot, if that stands still
    witnesses = [total / max(freedom - len(turns), 1)]
    if glimpses[0].wander_px2 is None:
        witnesses.append(_restlessness(normal.sum(axis=0), gradient.sum(axis=0)))
    birge = max(1.0, float(np.sqrt(max(witnesses))))
    scores = _centre_equations(normal, gradient, turns, parallax)[1]
    unlike = max(birge**2, _disagreement(covariance, scores, groups))
    told = normal[:, :, 0, 0].sum(axis=1)
    return Look(
        patches=_one_by_one(patches),
        heights=heights,
        plane=plane,
        pivot_px=start + error,
        pivot_covariance_px2=unlike * covariance[:2, :2],
        variance=variance,
        groups=groups,
        birge=birge,
        middle_px=told @ (tiles.corners + SIDE_PX / 2) / told.sum(),
    )


def find_turn(look: Look, glimpse: Glimpse, before: Image | None = None) -> Turn:
    """Find one frame's turn.

    Parameters
    ----------
    look : Look
        From `learn`.
    glimpse : Glimpse
        With the coarse turn, and the pivot on the same ground as ``look.pivot_px``.
    before : ndarray, optional
        The frame before it, where the codec may have copied from there.

    Returns
    -------
    Turn
        With the uncertainty that its own noise, the scatter between tiles, and copies give it.
    """
    views, places = look_at(look.patches.corners, look.heights, [glimpse], look.plane, look.pivot_px)
    centres = look.pivot_px + look.heights[:, None] * look.plane.lens.parallax
    turn = glimpse.turn
    for _ in range(_STEPS):
        fit = compare(look.patches, views, np.full(len(look.patches), turn), centres)
        mean_square = np.where(fit.count > 0, fit.squares / np.maximum(fit.count, 1), np.inf)
        # motion blur and the like spoil all tiles alike, a hand or a hair only some
        usual = float(np.median(mean_square / look.variance))
        clear = (mean_square < _HIDDEN * max(usual, 1.0) * look.variance) & ~_covered(fit)
        if not clear.any() or not np.isfinite(usual):
            return LOST
        each = fit.weighted(np.where(clear, look.variance * max(usual, 1.0), np.inf))
        normal, gradient = each[0].sum(axis=0), each[1].sum(axis=0)
        if glimpse.wander_px2 is not None:
            normal, gradient = _wandering(normal, gradient, glimpse.wander_px2)
        step = gradient[0] / normal[0, 0]
        turn += step
        if abs(step) < _SETTLED:
            break
    c, s = np.cos(turn), np.sin(turn)
    pull = -normal[0, 1:] @ (np.eye(2) - np.array([[c, -s], [s, c]])) / normal[0, 0]
    noise = 1 / float(np.sqrt(normal[0, 0]))
    # a frame that a codec spoils more than others shows it in its own tiles, as far as so few can tell
    total, freedom = _scatter(each[0][:, None], each[1][:, None], look.groups)
    birge2 = (_TRUST * look.birge**2 + total) / (_TRUST + max(freedom - 1, 0))
    pose2 = noise**2 * max(birge2 - 1, 0.0)
    if before is not None:
        misfit = noise * np.sqrt(fit.count[clear].sum())
        pose2 += (_COPY * _copied(glimpse.image, before, places[clear]) * misfit) ** 2
    return Turn(float(turn), noise, float(np.sqrt(pose2)), pull)


def _wandering(normal: Floats, gradient: Floats, covariance_px2: Floats) -> tuple[Floats, Floats]:
    """Let the pivot lie where the frame wants it, as far as is known where it is: eliminate its displacement.

    Its covariance is taken to be the same in all directions, so that the head's turn does not matter.
    """
    free = normal[1:, 1:] + np.eye(2) / max(float(np.trace(covariance_px2)) / 2.0, 1e-9)
    taken = np.linalg.solve(free, np.column_stack([normal[1:, :1], gradient[1:]]))
    told = normal.copy()
    told[0, 0] -= normal[0, 1:] @ taken[:, 0]
    pulled = gradient.copy()
    pulled[0] -= normal[0, 1:] @ taken[:, 1]
    return told, pulled


def nearest_fit(look: Look, glimpse: Glimpse, reach_px: float) -> Glimpse:
    """Try turns about a doubtful one, a pixel apart at the tiles' middle, and start from the one that fits best.

    Parameters
    ----------
    look : Look
        From `learn`.
    glimpse : Glimpse
        With a turn that may be wrong.
    reach_px : float
        How far to try to either side, px.

    Returns
    -------
    Glimpse
        With another turn.
    """
    centres = look.pivot_px + look.heights[:, None] * look.plane.lens.parallax
    step = 1.0 / float(np.hypot(*(look.middle_px - look.pivot_px)))
    tries = [replace(glimpse, turn=glimpse.turn + k * step) for k in range(-int(reach_px), int(reach_px) + 1)]

    def misfit(one: Glimpse) -> float:
        views, _ = look_at(look.patches.corners, look.heights, [one], look.plane, look.pivot_px)
        fit = compare(look.patches, views, np.full(len(look.patches), one.turn), centres)
        seen = fit.count > 0
        return float(np.median(fit.squares[seen] / fit.count[seen] / look.variance[seen])) if seen.any() else np.inf

    misfits = [misfit(one) for one in tries]
    best = int(np.argmin(misfits))
    # a smeared head fits nowhere well: there the guess is not overruled
    return tries[best] if misfits[best] < _BETTER * misfits[len(tries) // 2] else glimpse


def _compare_all(patches: Sequence[Patches], views: Sequence[Views], turns: Floats, centres: Floats) -> Fit:
    """Compare every tile with every frame: rows are tiles, columns frames."""
    fits = [compare(p, v, turns, c[None]) for p, v, c in zip(patches, views, centres, strict=True)]
    return Fit(
        np.stack([f.normal for f in fits]),
        np.stack([f.gradient for f in fits]),
        np.stack([f.squares for f in fits]),
        np.stack([f.count for f in fits]),
        np.stack([f.light for f in fits]),
    )


def _hidden(fits: Fit) -> NDArray[np.bool_]:
    """Tell in which frames a tile is seen badly: what passes before it is not learnt."""
    mean_square = fits.squares / np.maximum(fits.count, 1)
    usual = np.median(mean_square, axis=1, keepdims=True)
    # motion blur and the like spoil all tiles alike
    spoilt = np.maximum(np.median(mean_square / usual, axis=0, keepdims=True), 1.0)
    return np.asarray((mean_square > _HIDDEN * spoilt * usual) | _covered(fits))


def _covered(fits: Fit) -> NDArray[np.bool_]:
    """Tell which views show something else, however flat: it fits any look that is dimmed to nothing."""
    return np.asarray((np.abs(fits.light[..., 0]) > _DIMMED).any(axis=-1))


def _centre_equations(normal: Floats, gradient: Floats, turns: Floats, parallax: Floats) -> tuple[Floats, Floats]:
    """Return what tiles say of the errors of pivot and heights: information, and every tile's score.

    A turned tile seems displaced by t = (1 − R)·(e + p·h). Every frame's turn is free: it is eliminated. Where there
    is no parallax, heights do not count.
    """
    c, s = np.cos(turns), np.sin(turns)
    moved = np.eye(2) - np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=-2)
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
    return information, scores


def _centres_error(
    information: Floats, scores: Floats, prior: _Prior, so_far: Floats, heights: Floats
) -> tuple[Floats, Floats, Floats]:
    """Solve for the errors of pivot and heights; return the covariance too, all in units of the pixels' noise."""
    known, right = information.copy(), scores.sum(axis=0)
    known[:2, :2] += prior.pivot
    right[:2] -= prior.pivot @ so_far
    tall = len(known) > 2
    if tall:
        known[2:, 2:] += prior.height * np.eye(len(heights))
        right[2:] -= prior.height * heights
    covariance = np.asarray(np.linalg.inv(known), dtype=float)
    found = covariance @ right
    return found[:2], found[2:] if tall else np.zeros(len(heights)), covariance


def _disagreement(covariance: Floats, scores: Floats, groups: NDArray[np.intp]) -> float:
    """Ratio of the pivot's variance as groups of tiles disagree about it to what noise alone makes it.

    The cluster-robust sandwich (Liang & Zeger 1986), a cluster a group.
    """
    names = np.unique(groups)
    told = np.stack([scores[groups == group].sum(axis=0) for group in names]) @ covariance
    variance = float((told[:, :2] ** 2).sum()) * len(names) / max(len(names) - 2, 1)
    return variance / float(np.trace(covariance[:2, :2]))


def _scatter(normal: Floats, gradient: Floats, groups: NDArray[np.intp]) -> tuple[float, int]:
    """Sum the squares of what groups of tiles say against the common turn, in units of their noise; and count them.

    Neighbours share a codec's blocks and err together: only what lies apart tells.
    """
    total, count = 0.0, 0
    for group in np.unique(groups):
        known, pull = normal[groups == group, :, 0, 0].sum(axis=0), gradient[groups == group, :, 0].sum(axis=0)
        seen = known > 0
        total += float((pull[seen] ** 2 / known[seen]).sum())
        count += int(seen.sum())
    return total, count


def _restlessness(normal: Floats, gradient: Floats) -> float:
    """Mean square of the displacement that a head on a fixed pivot cannot have, in units of its noise."""
    seen = normal[:, 0, 0] > _NOTHING
    normal, gradient = normal[seen], gradient[seen]
    place = normal[:, 1:, 1:] - normal[:, 1:, :1] * normal[:, :1, 1:] / normal[:, :1, :1]
    shift = gradient[:, 1:] - normal[:, 1:, 0] * (gradient[:, :1] / normal[:, :1, 0])
    return float(np.einsum("ni,nij,nj->n", shift, np.linalg.inv(place), shift).mean() / 2.0)


def _groups(corners: Floats) -> NDArray[np.intp]:
    """Put tiles that lie together into groups."""
    if len(corners) <= 2 * GROUPS:
        return np.arange(len(corners))
    return np.asarray(kmeans2(corners, GROUPS, minit="++", seed=0)[1])


def _one_by_one(patches: Sequence[Patches]) -> Patches:
    return Patches(
        np.concatenate([p.corners for p in patches]),
        patches[0].side,
        np.concatenate([p.coefficients for p in patches]),
        np.concatenate([p.gains for p in patches]),
    )


def _copied(image: Image, before: Image, centres_px: Floats) -> float:
    """Return the share of the tiles' pixels that are what they were a frame before."""
    half = SIDE_PX // 2
    shares = []
    for x, y in centres_px.round().astype(int):
        part = np.s_[max(y - half, 0) : y + half, max(x - half, 0) : x + half]
        if image[part].size:
            shares.append(float((image[part] == before[part]).mean()))
    return float(np.mean(shares)) if shares else 0.0
