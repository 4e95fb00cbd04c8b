"""The head's turn from all that is rigid on it: many small patches, each learnt from the clip itself.

A coarse angle, good to a few hundredths of a pixel, lets the frames be turned back onto one another. What then stands
still is the head; where it has edges, it has information. The best tiles are learnt (`anglecam.vision.patch`), and each
frame's turn is the one at which they fit best, by Gauss and Newton, weighted by their noise.

What the tiles say of one turn scatters more than their pixels' noise alone would make it: codecs err in blocks, light
is not quite a slow gain. That scatter between tiles, the Birge ratio (Birge 1932), multiplies the uncertainty.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.cluster.vq import kmeans2

from anglecam.vision.patch import Fit, Patch, Tile, Views, compare, learn_patch

Image = NDArray[Any]
"""Bytes, but cv2's type hints do not know it."""
Floats = NDArray[np.float64]

SIDE_PX = 16
MOST_TILES = 40
GROUPS = 6
_STACK = 15
"""Frames that are turned back to see what is rigid."""
_LOOSE = 6.0
"""Robust standard deviations of the noise beyond which a place of the stack is not rigid, or not lit alike."""
_LOOSE_SHARE = 0.1
_STEADIER = 1.5
"""Ratio of squared spreads, as filmed over turned back, from which on a tile belongs to the head."""
_ROUNDS = 12
_SETTLED_PX = 0.003
"""The look and the pivot are learnt in turn until the pivot moves by less."""
_STEPS = 3
"""Of Gauss and Newton: from a few hundredths of a pixel the second one changes nothing that could be seen."""
_TRUST = 3.0
"""Degrees of freedom that the whole clip's scatter has against a single frame's."""
_HIDDEN = 3.0
"""Times its usual mean square that a tile misfits in a frame where something hides it."""


@dataclass(frozen=True)
class Glimpse:
    """A frame, and where the coarse measurement has the head in it."""

    image: Image
    turn: float
    """Counter-clockwise as seen, from the reference, rad."""
    pivot_px: Floats
    """(2,) of this frame, px."""


@dataclass(frozen=True)
class Look:
    """The head as it was learnt."""

    patches: tuple[Patch, ...]
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


def choose_tiles(glimpses: Sequence[Glimpse], noise: float) -> list[Tile]:
    """Find where the head is rigid and has edges.

    Parameters
    ----------
    glimpses : sequence of Glimpse
        Frames at turns that differ.
    noise : float
        Standard deviation of the pixels, grey levels.

    Returns
    -------
    list of Tile
        The most telling first.
    """
    height, width = glimpses[0].image.shape[:2]
    pivot = glimpses[0].pivot_px
    stack, seen = [], np.full((height, width), 255, np.uint8)
    for glimpse in glimpses:
        c, s = np.cos(glimpse.turn), np.sin(glimpse.turn)
        back = np.array([[c, -s], [s, c]])
        move = np.column_stack([back, pivot - back @ glimpse.pivot_px])
        turned = cv2.warpAffine(glimpse.image, move, (width, height), flags=cv2.INTER_LINEAR)
        stack.append(turned.reshape(height, width, -1).astype(np.float32))
        seen = np.minimum(seen, cv2.warpAffine(np.full((height, width), 255, np.uint8), move, (width, height)))
    look, spread = _middle_and_spread(np.stack(stack))
    unturned = _middle_and_spread(np.stack([g.image for g in glimpses]).astype(np.float32))[1]
    smooth = cv2.GaussianBlur(look, (0, 0), 0.7)
    along_x, along_y = (
        cv2.Scharr(smooth, cv2.CV_32F, *axis, scale=1 / 32).reshape(look.shape) for axis in ((1, 0), (0, 1))
    )
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    by_turn = along_y * (x - pivot[0])[..., None] - along_x * (y - pivot[1])[..., None]
    whole = seen == 255
    information = (by_turn**2 / (noise**2 + spread**2)).sum(axis=2) * whole
    loose = ((spread.max(axis=2) > _LOOSE * noise) | ~whole).astype(np.float32)
    rows, columns = height // SIDE_PX, width // SIDE_PX
    per_tile = [
        part[: rows * SIDE_PX, : columns * SIDE_PX].reshape(rows, SIDE_PX, columns, SIDE_PX)
        for part in (information, loose, (spread**2).sum(axis=2), (unturned**2).sum(axis=2))
    ]
    rigid = per_tile[1].mean(axis=(1, 3)) < _LOOSE_SHARE
    # the scenery does not turn: it is steadier as it is filmed
    turning = per_tile[3].mean(axis=(1, 3)) > _STEADIER * per_tile[2].mean(axis=(1, 3))
    worth = np.where(rigid & turning, per_tile[0].sum(axis=(1, 3)), 0.0)
    best = np.argsort(worth, axis=None)[::-1][:MOST_TILES]
    return [
        Tile(SIDE_PX * np.array([k % columns, k // columns], dtype=float), SIDE_PX) for k in best if worth.flat[k] > 0
    ]


def learn(glimpses: Sequence[Glimpse], tiles: Sequence[Tile], pivot_covariance_px2: Floats) -> Look:
    """Learn how the tiles look, where the head turns, and what its turns are, all from the same frames.

    Parameters
    ----------
    glimpses : sequence of Glimpse
        Frames at turns that differ.
    tiles : sequence of Tile
        From `choose_tiles`.
    pivot_covariance_px2 : ndarray
        (2, 2) of the pivot that the glimpses assume, px²; where the head hardly turns, it is all that is known.

    Returns
    -------
    Look
        In a frame of reference whose pivot is the learnt one.
    """
    turns = np.array([g.turn for g in glimpses])
    pivot, error = glimpses[0].pivot_px, np.zeros(2)
    prior = np.asarray(np.linalg.inv(pivot_covariance_px2), dtype=float)
    views = [look_at(tile, glimpses, pivot) for tile in tiles]
    patches: list[Patch] = [learn_patch(t, v, turns, pivot) for t, v in zip(tiles, views, strict=True)]
    for _ in range(_ROUNDS):
        patches = [learn_patch(p.tile, v, turns, pivot + error, p) for p, v in zip(patches, views, strict=True)]
        fits = [compare(p, v, turns, pivot + error) for p, v in zip(patches, views, strict=True)]
        variance = _variances(fits)
        normal, gradient = _together(fits, variance)
        moved, covariance = _pivot_error(normal, gradient, turns, prior, error)
        error = error + moved
        views = [replace(v, offsets=v.offsets - moved) for v in views]
        fits = [compare(p, v, turns, pivot + error) for p, v in zip(patches, views, strict=True)]
        normal, gradient = _together(fits, variance)
        turns = turns + gradient[:, 0] / normal[:, 0, 0]
        if np.hypot(*moved) < _SETTLED_PX:
            break
    fits = [compare(p, v, turns, pivot + error) for p, v in zip(patches, views, strict=True)]
    groups = _groups(tiles)
    total, freedom = _scatter(fits, _variances(fits), groups)
    normal, gradient = _together(fits, _variances(fits))
    # two witnesses: groups that disagree about the turn, and a head that seems to leave its pivot
    witnesses = (total / max(freedom - len(turns), 1), _restlessness(normal, gradient))
    birge = max(1.0, float(np.sqrt(max(witnesses))))
    return Look(tuple(patches), pivot + error, birge**2 * covariance, _variances(fits), groups, birge)


def find_turn(look: Look, glimpse: Glimpse) -> Turn:
    """Find one frame's turn.

    Parameters
    ----------
    look : Look
        From `learn`.
    glimpse : Glimpse
        With the coarse turn, and the pivot on the same ground as ``look.pivot_px``.

    Returns
    -------
    Turn
        With the uncertainty that its own noise, and the scatter between tiles, give it.
    """
    views = [look_at(patch.tile, [glimpse], look.pivot_px) for patch in look.patches]
    turn = np.array([glimpse.turn])
    for _ in range(_STEPS):
        fits = [compare(p, v, turn, look.pivot_px) for p, v in zip(look.patches, views, strict=True)]
        mean_square = np.array([f.squares[0] / f.count[0] if f.count[0] else np.inf for f in fits])
        # motion blur and the like spoil all tiles alike, a hand or a hair only some
        usual = np.median(mean_square / look.variance)
        clear = mean_square < _HIDDEN * max(usual, 1.0) * look.variance
        if not clear.any() or not np.isfinite(usual):
            return Turn(np.nan, np.nan, np.nan, np.full(2, np.nan))
        kept = [fit for fit, ok in zip(fits, clear, strict=True) if ok]
        normal, gradient = _together(kept, look.variance[clear] * max(usual, 1.0))
        turn = turn + gradient[:, 0] / normal[:, 0, 0]
    c, s = np.cos(turn[0]), np.sin(turn[0])
    pull = -normal[0, 0, 1:] @ (np.eye(2) - np.array([[c, -s], [s, c]])) / normal[0, 0, 0]
    noise = 1 / float(np.sqrt(normal[0, 0, 0]))
    # a frame that a codec spoils more than others shows it in its own tiles, as far as so few can tell
    total, freedom = _scatter(kept, look.variance[clear] * max(usual, 1.0), look.groups[clear])
    birge2 = (_TRUST * look.birge**2 + total) / (_TRUST + max(freedom - 1, 0))
    return Turn(float(turn[0]), noise, noise * float(np.sqrt(max(birge2 - 1, 0.0))), pull)


def look_at(tile: Tile, glimpses: Iterable[Glimpse], pivot: Floats) -> Views:
    """Collect what frames show of a tile, and a little around it."""
    offsets, values, starts = [], [], [0]
    for g in glimpses:
        offset, value = _gather(g.image, g.pivot_px, g.turn, tile.corner, tile.side, pivot)
        offsets.append(offset)
        values.append(value)
        starts.append(starts[-1] + len(offset))
    return Views(np.concatenate(offsets), np.concatenate(values), np.array(starts))


def _middle_and_spread(pile: Image) -> tuple[Image, Image]:
    middle: Image = np.median(pile, axis=0)
    spread: Image = 1.4826 * np.median(np.abs(pile - middle), axis=0)
    return middle, spread


def _variances(fits: Sequence[Fit]) -> Floats:
    return np.array([fit.squares.sum() / max(int(fit.count.sum()), 1) for fit in fits])


def _together(fits: Sequence[Fit], variance: Floats) -> tuple[Floats, Floats]:
    normal = sum((fit.normal / v for fit, v in zip(fits, variance, strict=True)), np.zeros(3))
    gradient = sum((fit.gradient / v for fit, v in zip(fits, variance, strict=True)), np.zeros(3))
    return np.asarray(normal, dtype=float), np.asarray(gradient, dtype=float)


def _pivot_error(
    normal: Floats, gradient: Floats, turns: Floats, prior: Floats, so_far: Floats
) -> tuple[Floats, Floats]:
    """Find the pivot's error from the way in which turned heads seem to be displaced: t = (1 − R)·e."""
    information, right = prior.copy(), -prior @ so_far
    for one, pull, turn in zip(normal, gradient, turns, strict=True):
        c, s = np.cos(turn), np.sin(turn)
        moved = np.eye(2) - np.array([[c, -s], [s, c]])
        # the turn is free: eliminate it
        place = one[1:, 1:] - np.outer(one[1:, 0], one[0, 1:]) / one[0, 0]
        shift = pull[1:] - one[1:, 0] * pull[0] / one[0, 0]
        information += moved.T @ place @ moved
        right += moved.T @ shift
    covariance = np.asarray(np.linalg.inv(information), dtype=float)
    return covariance @ right, covariance


def _scatter(fits: Sequence[Fit], variance: Floats, groups: NDArray[np.intp]) -> tuple[float, int]:
    """Sum the squares of what groups of tiles say against the common turn, in units of their noise; and count them.

    Neighbours share a codec's blocks and err together: only what lies apart tells.
    """
    total, count = 0.0, 0
    for group in np.unique(groups):
        of_it = [fit for fit, g in zip(fits, groups, strict=True) if g == group]
        normal, gradient = _together(of_it, variance[groups == group])
        seen = normal[:, 0, 0] > 0
        total += float((gradient[seen, 0] ** 2 / normal[seen, 0, 0]).sum())
        count += int(seen.sum())
    return total, count


def _restlessness(normal: Floats, gradient: Floats) -> float:
    """Mean square of the displacement that a head on a fixed pivot cannot have, in units of its noise."""
    place = normal[:, 1:, 1:] - normal[:, 1:, :1] * normal[:, :1, 1:] / normal[:, :1, :1]
    shift = gradient[:, 1:] - normal[:, 1:, 0] * (gradient[:, :1] / normal[:, :1, 0])
    return float(np.einsum("ni,nij,nj->n", shift, np.linalg.inv(place), shift).mean() / 2.0)


def _groups(tiles: Sequence[Tile]) -> NDArray[np.intp]:
    """Put tiles that lie together into groups."""
    places = np.array([tile.corner for tile in tiles])
    if len(tiles) <= 2 * GROUPS:
        return np.arange(len(tiles))
    return np.asarray(kmeans2(places, GROUPS, minit="++", seed=0)[1])


@njit(cache=True)
def _gather(image, here, turn, corner, side, pivot):  # type: ignore[no-untyped-def]
    c, s = np.cos(turn), np.sin(turn)
    across, down = corner[0] + side / 2 - pivot[0], corner[1] + side / 2 - pivot[1]
    x0, y0 = c * across + s * down + here[0], -s * across + c * down + here[1]
    reach = 0.71 * side + 1.5
    top, bottom = max(0, int(y0 - reach)), min(image.shape[0], int(y0 + reach) + 2)
    left, right = max(0, int(x0 - reach)), min(image.shape[1], int(x0 + reach) + 2)
    room = max(0, bottom - top) * max(0, right - left)
    offsets, values, count = np.empty((room, 2)), np.empty((room, image.shape[2]), np.float32), 0
    for y in range(top, bottom):
        for x in range(left, right):
            vx, vy = x - here[0], y - here[1]
            at_x = pivot[0] + c * vx - s * vy - corner[0]
            at_y = pivot[1] + s * vx + c * vy - corner[1]
            if at_x < -0.5 or at_y < -0.5 or at_x > side + 0.5 or at_y > side + 0.5:
                continue
            offsets[count, 0], offsets[count, 1] = vx, vy
            for channel in range(image.shape[2]):
                values[count, channel] = image[y, x, channel]
            count += 1
    return offsets[:count], values[:count]
