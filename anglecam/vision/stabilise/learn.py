"""Learn the scenery in a clip whose camera moves.

The appearance of the tiles and the motions of the frames are found alternately, each for the current estimate of the
other. The ratio of the tiles' disagreement to that expected from their noise is estimated too, direction by direction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve1d
from threadpoolctl import threadpool_limits

from anglecam.data.typing import Floats, Image
from anglecam.vision.image.transforms import rotation
from anglecam.vision.registration.appearance import (
    HIDDEN_MISFIT,
    KNOT_SPACING_PX,
    TileAppearance,
    TileFit,
    compare_tiles,
    equalise_brightness,
    join_tiles,
    learn_tile,
)
from anglecam.vision.stabilise.background_motion import BackgroundMotion, free_parameters, solve_motion
from anglecam.vision.stabilise.scenery import Scenery, find_scenery
from anglecam.vision.stabilise.tile_cuts import TILE_MARGIN_PX, TileCuts, as_views, brightness, cut_tiles
from anglecam.vision.stabilise.windows import WINDOW_SIDE_PX, subtract_local_mean

_MIN_FRAMES = 8
"""Fewest frames to learn from."""
_MIN_TILES = 4
_MAX_TILES = 24
"""The tiles with the most information."""
_BLURRED_ROUNDS, _SHARP_ROUNDS = 2, 2
"""Rounds of learning appearance and motions alternately. Motions with an error that is a function of their fraction of
a pixel fit nearly as well as the true ones, because the appearance then gets a ripple with the pixels' period. A
blurred appearance cannot have such a ripple."""
_BLUR = (0.25, 0.5, 0.25)
"""Weights of neighbouring knots, half a pixel apart: they remove any ripple with the pixels' period."""
_MAX_VARIANCE_RATIO = 5.0
"""Variance of a tile over the median, from which on something moves in the tile."""
_PART_PX = 64
"""Side of the parts of the picture, px, whose tiles form one group when their disagreement is estimated."""
_SIGNIFICANT_ROLL = 9.0
"""Mean square of the rolls in the frames, in units of their variance, from which on the camera is taken to roll."""


def learn_background(images: Sequence[Image]) -> BackgroundMotion | None:
    """Learn the scenery of a clip whose camera moves.

    Parameters
    ----------
    images : sequence of ndarray
        (h, w, 3) blue, green, red, spread over a clip; around thirty.

    Returns
    -------
    BackgroundMotion or None
        ``None`` where the camera stands still or may do so, or where too little scenery is visible to measure its
        motion.
    """
    pictures = [brightness(image) for image in images]
    scenery = find_scenery(pictures)
    if scenery is None or not scenery.shakes:
        return None
    known = np.flatnonzero(np.isfinite(scenery.rolls))
    if len(known) < _MIN_FRAMES:
        return None
    with threadpool_limits(limits=1, user_api="blas"):  # the systems are small: more threads only wait for one another
        return _learn(scenery, [pictures[k] for k in known], scenery.shifts_px[known], scenery.rolls[known])


@dataclass(frozen=True)
class _Learnt:
    tiles: TileAppearance
    variance: Floats
    """(tiles,) mean squared residual, grey levels squared."""
    shifts_px: Floats
    """(frames, 2)."""
    rolls: Floats
    """(frames,) rad."""
    normal: Floats
    """(frames, 3, 3) of roll, x and y, divided by the variances."""
    covariance_ratio: Floats
    """(3, 3) see `BackgroundMotion`."""


def _learn(scenery: Scenery, pictures: Sequence[Image], shifts: Floats, rolls: Floats) -> BackgroundMotion | None:
    """Learn with rolls, then again without tiles in which something moves, and without rolls if they are only noise."""
    size, typical_shift = pictures[0].shape[1::-1], np.quantile(np.abs(shifts), 0.7, axis=0)
    tiles = _part_of(scenery, _most_informative(scenery, size, typical_shift))
    if len(tiles.centres_px) < _MIN_TILES:
        return None
    cuts = cut_tiles(pictures, tiles, shifts, rolls)
    learnt = _alternate(cuts, tiles, shifts, rolls, rounds=_BLURRED_ROUNDS, sharp=0, rolling=True)
    roll_information = 1.0 / np.linalg.inv(learnt.normal)[:, 0, 0]
    rolling = bool(np.var(learnt.rolls) * roll_information.mean() > _SIGNIFICANT_ROLL * learnt.covariance_ratio[0, 0])
    still = np.flatnonzero(learnt.variance < _MAX_VARIANCE_RATIO * np.median(learnt.variance))
    tiles = _part_of(tiles, still)
    shifts, rolls = learnt.shifts_px, learnt.rolls if rolling else 0.0 * rolls
    cuts = cut_tiles(pictures, tiles, shifts, rolls)
    rounds = _BLURRED_ROUNDS + _SHARP_ROUNDS
    learnt = _alternate(cuts, tiles, shifts, rolls, rounds=rounds, sharp=_SHARP_ROUNDS, rolling=rolling)
    return BackgroundMotion(
        subtract_local_mean(pictures[0]), tiles, learnt.tiles, learnt.variance, rolling, learnt.covariance_ratio
    )


def _most_informative(scenery: Scenery, size: tuple[int, ...], typical_shift: Floats) -> NDArray[np.intp]:
    """Choose windows that mostly stay inside the picture and together give the most information in every direction."""
    border = WINDOW_SIDE_PX / 2.0 + TILE_MARGIN_PX + typical_shift
    inside = np.all((scenery.centres_px >= border) & (scenery.centres_px <= size - border), axis=1)
    tensor = np.einsum("n,n,nab->nab", inside, scenery.information, scenery.metric)
    total, chosen = 1e-3 * tensor.sum(axis=0) + 1e-9 * np.eye(2), []
    for _ in range(min(_MAX_TILES, int(inside.sum()))):
        gain = np.einsum("ab,nba->n", np.linalg.inv(total), tensor)
        best = int(gain.argmax())
        total = total + tensor[best]
        tensor[best] = 0.0
        chosen.append(best)
    return np.array(chosen, dtype=np.intp)


def _part_of(scenery: Scenery, some: NDArray[np.intp]) -> Scenery:
    return replace(
        scenery,
        centres_px=scenery.centres_px[some],
        metric=scenery.metric[some],
        information=scenery.information[some],
    )


def _alternate(
    cuts: TileCuts, scenery: Scenery, shifts: Floats, rolls: Floats, *, rounds: int, sharp: int, rolling: bool
) -> _Learnt:
    """Learn appearance and motions alternately; all but the last ``sharp`` rounds blur the appearance."""
    origin, corners = scenery.origin_px, scenery.centres_px - WINDOW_SIDE_PX / 2.0
    clear = cuts.whole.copy()
    # Share of the frames' noise that the appearance has absorbed.
    absorbed = 1.0 / (KNOT_SPACING_PX**2 * len(shifts))
    light: list[Floats | None] = [None] * len(corners)
    tiles: list[TileAppearance] = []
    for remaining in reversed(range(rounds)):
        offsets = cuts.pixels - (origin + shifts)[:, None, None]
        tiles, fits = [], []
        for t, corner in enumerate(corners):
            of_tile = light[t]
            views = as_views(offsets[clear[:, t], t], cuts.values[clear[:, t], t])
            views = views if of_tile is None else equalise_brightness(views, of_tile[clear[:, t]])
            tile = learn_tile(corner, WINDOW_SIDE_PX, views, rolls[clear[:, t]], origin, np.zeros(2), np.zeros(2))
            # The camera's motion does not change the light on the scenery.
            tile = replace(tile, gains=0.0 * tile.gains)
            if remaining >= sharp:
                tile = replace(tile, coefficients=_blurred(tile.coefficients))
            tiles.append(tile)
            fits.append(compare_tiles(tile, as_views(offsets[:, t], cuts.values[:, t]), rolls, origin[None]).rigid())
            light[t] = fits[-1].light
        clear, variance = _clear_views(fits, cuts, absorbed)
        weight = clear.T / variance[:, None]
        normals = np.stack([f.normal for f in fits]) * weight[..., None, None]
        gradients = np.stack([f.gradient for f in fits]) * weight[..., None]
        if remaining:
            together = zip(normals.sum(axis=0), gradients.sum(axis=0), np.asarray(clear.any(axis=1)), strict=True)
            steps = np.array([solve_motion(n, g, rolling)[0] if seen else np.zeros(3) for n, g, seen in together])
            shifts = shifts - np.array([s[1:] @ rotation(roll) for s, roll in zip(steps, rolls, strict=True)])
            rolls = rolls + steps[:, 0]
    return _Learnt(
        join_tiles(tiles),
        variance,
        shifts,
        rolls,
        normals.sum(axis=0),
        _disagreement(normals, gradients, scenery.centres_px, rolling) * (1.0 + absorbed) / (1.0 - absorbed),
    )


def _clear_views(fits: Sequence[TileFit], cuts: TileCuts, absorbed: float) -> tuple[NDArray[np.bool_], Floats]:
    """Return the views (frames, tiles) that nothing hides, and the tiles' variance (tiles,), grey levels squared."""
    mean_square = np.stack([f.squares / np.maximum(f.count, 1) for f in fits])
    usual = np.median(mean_square, axis=1)
    clear = cuts.whole & (mean_square < HIDDEN_MISFIT * usual[:, None]).T
    variance = np.array([m[ok].mean() for m, ok in zip(mean_square, clear.T, strict=True)]) / (1.0 - absorbed)
    return clear, variance


def _blurred(coefficients: Floats) -> Floats:
    return np.asarray(convolve1d(convolve1d(coefficients, _BLUR, axis=-1), _BLUR, axis=-2))


def _disagreement(normals: Floats, gradients: Floats, places: Floats, rolling: bool) -> Floats:
    """Return the ratio (3, 3) of the covariance from the disagreement of parts of the scenery to that of noise alone.

    The cluster-robust sandwich (Liang & Zeger 1986): neighbouring tiles share a codec's blocks, so their errors are
    correlated.
    """
    _, part = np.unique((places // _PART_PX).astype(int), axis=0, return_inverse=True)
    member = (part[:, None] == np.arange(part.max() + 1)).astype(float)
    free = free_parameters(rolling)
    ratios = []
    for normal, gradient in zip(normals.swapaxes(0, 1), gradients.swapaxes(0, 1), strict=True):
        if not normal.any():
            continue  # something hides all of the scenery
        step, covariance = solve_motion(normal.sum(axis=0), gradient.sum(axis=0), rolling)
        lower = np.linalg.cholesky(covariance[free, free])
        scores = (member.T @ (gradient - normal @ step))[:, free] @ lower
        seen = np.count_nonzero(scores.any(axis=1))
        ratios.append(scores.T @ scores * seen / max(seen - 2, 1))
    values, vectors = np.linalg.eigh(np.mean(ratios, axis=0))
    ratio = np.eye(3)
    ratio[free, free] = vectors @ np.diag(np.maximum(values, 1.0)) @ vectors.T
    return ratio
