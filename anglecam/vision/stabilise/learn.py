"""Learning the scenery of a camera that does not stand still.

Looks of tiles and motions of frames are found in turn, each for the other as it is so far. How much more the tiles
disagree than their noise would make them, direction by direction, is learnt along.
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
    compare_tiles,
    equalise_brightness,
    join_tiles,
    learn_tile,
)
from anglecam.vision.stabilise.background_motion import (
    TILE_MARGIN_PX,
    BackgroundMotion,
    TileCuts,
    as_views,
    brightness,
    cut_tiles,
    free_parameters,
    solve_motion,
)
from anglecam.vision.stabilise.scenery import Scenery, find_scenery
from anglecam.vision.stabilise.windows import WINDOW_SIDE_PX, subtract_local_mean

_FEWEST = 8
"""Frames to learn from."""
_FEWEST_TILES = 4
_TILES = 24
"""The most telling ones."""
_BLURRED_ROUNDS, _SHARP_ROUNDS = 2, 2
"""Of learning looks and motions in turn. A motion that is wrong by a function of its fraction of a pixel fits nearly as
well as the true one, by looks that are wobbly with the pixels' period; blurred looks cannot be."""
_BLUR = (0.25, 0.5, 0.25)
"""Of neighbouring knots, half a pixel apart: nothing of the pixels' period is left."""
_RESTLESS = 5.0
"""Times the median misfit that a tile has in which something moves."""
_PART_PX = 64
"""Of the picture, whose tiles are heard together about how much they disagree with others."""
_ROLLS = 9.0
"""Mean square of the rolls in the frames learnt from, in units of their variance, from which on the camera rolls."""


def learn_background(images: Sequence[Image]) -> BackgroundMotion | None:
    """Learn the scenery where the camera does not stand still.

    Parameters
    ----------
    images : sequence of ndarray
        (h, w, 3) blue, green, red, spread over a clip; some thirty.

    Returns
    -------
    BackgroundMotion or None
        ``None`` where the camera stands still, or may do so, or too little is seen of the scenery to say how it moves.
    """
    pictures = [brightness(image) for image in images]
    scenery = find_scenery(pictures)
    if scenery is None or not scenery.shakes:
        return None
    known = np.flatnonzero(np.isfinite(scenery.rolls))
    if len(known) < _FEWEST:
        return None
    with threadpool_limits(limits=1, user_api="blas"):  # small systems: threads only wait for one another
        return _learn(scenery, [pictures[k] for k in known], scenery.shifts_px[known], scenery.rolls[known])


@dataclass(frozen=True)
class _Learnt:
    patches: TileAppearance
    variance: Floats
    shifts_px: Floats
    rolls: Floats
    normal: Floats
    """(frames, 3, 3) of roll, x and y, over the variances."""
    unlike: Floats


def _learn(scenery: Scenery, pictures: Sequence[Image], shifts: Floats, rolls: Floats) -> BackgroundMotion | None:
    """Learn with rolls; then, where these are chance, without, and without the tiles in which something moves."""
    tiles = _part_of(
        scenery, _most_telling(scenery, pictures[0].shape[1::-1], np.quantile(np.abs(shifts), 0.7, axis=0))
    )
    if len(tiles.centres_px) < _FEWEST_TILES:
        return None
    cuts = cut_tiles(pictures, tiles, shifts, rolls)
    learnt = _in_turn(cuts, tiles, shifts, rolls, rounds=_BLURRED_ROUNDS, sharp=0, rolling=True)
    by_roll = 1.0 / np.linalg.inv(learnt.normal)[:, 0, 0]
    rolling = bool(np.var(learnt.rolls) * by_roll.mean() > _ROLLS * learnt.unlike[0, 0])
    tiles = _part_of(tiles, np.flatnonzero(learnt.variance < _RESTLESS * np.median(learnt.variance)))
    shifts, rolls = learnt.shifts_px, learnt.rolls if rolling else 0.0 * rolls
    cuts = cut_tiles(pictures, tiles, shifts, rolls)
    rounds = _BLURRED_ROUNDS + _SHARP_ROUNDS
    learnt = _in_turn(cuts, tiles, shifts, rolls, rounds=rounds, sharp=_SHARP_ROUNDS, rolling=rolling)
    return BackgroundMotion(
        subtract_local_mean(pictures[0]), tiles, learnt.patches, learnt.variance, rolling, learnt.unlike
    )


def _most_telling(scenery: Scenery, size: tuple[int, ...], reach_px: Floats) -> NDArray[np.intp]:
    """Choose the windows, mostly whole in the picture, that together tell most, in the worst direction too."""
    border = WINDOW_SIDE_PX / 2.0 + TILE_MARGIN_PX + reach_px
    inside = np.all((scenery.centres_px >= border) & (scenery.centres_px <= size - border), axis=1)
    tensor = np.einsum("n,n,nab->nab", inside, scenery.information, scenery.metric)
    total, chosen = 1e-3 * tensor.sum(axis=0) + 1e-9 * np.eye(2), []
    for _ in range(min(_TILES, int(inside.sum()))):
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


def _in_turn(
    cuts: TileCuts, scenery: Scenery, shifts: Floats, rolls: Floats, *, rounds: int, sharp: int, rolling: bool
) -> _Learnt:
    """Learn looks and motions in turn."""
    origin, corners = scenery.origin_px, scenery.centres_px - WINDOW_SIDE_PX / 2.0
    clear = cuts.whole.copy()
    # of the frames' own noise the looks have learnt this share by heart
    spent = 1.0 / (KNOT_SPACING_PX**2 * len(shifts))
    light: list[Floats | None] = [None] * len(corners)
    patches: list[TileAppearance] = []
    for left in reversed(range(rounds)):
        offsets = cuts.pixels - (origin + shifts)[:, None, None]
        patches, fits = [], []
        for t, corner in enumerate(corners):
            own = light[t]
            views = as_views(offsets[clear[:, t], t], cuts.values[clear[:, t], t])
            views = views if own is None else equalise_brightness(views, own[clear[:, t]])
            look = learn_tile(corner, WINDOW_SIDE_PX, views, rolls[clear[:, t]], origin)
            # light does not fall otherwise on scenery
            look = replace(look, gains=0.0 * look.gains)
            if left >= sharp:
                look = replace(look, coefficients=_blurred(look.coefficients))
            patches.append(look)
            fits.append(compare_tiles(look, as_views(offsets[:, t], cuts.values[:, t]), rolls, origin[None]))
            light[t] = fits[-1].light
        mean_square = np.stack([f.squares / np.maximum(f.count, 1) for f in fits])
        usual = np.median(mean_square, axis=1)
        clear = cuts.whole & (mean_square < HIDDEN_MISFIT * usual[:, None]).T
        variance = np.array([m[ok].mean() for m, ok in zip(mean_square, clear.T, strict=True)]) / (1.0 - spent)
        weight = clear.T / variance[:, None]
        normals = np.stack([f.normal for f in fits]) * weight[..., None, None]
        gradients = np.stack([f.gradient for f in fits]) * weight[..., None]
        if left:
            together = zip(normals.sum(axis=0), gradients.sum(axis=0), strict=True)
            steps = np.array([solve_motion(*one, rolling)[0] for one in together])
            shifts = shifts - np.array([s[1:] @ rotation(roll) for s, roll in zip(steps, rolls, strict=True)])
            rolls = rolls + steps[:, 0]
    return _Learnt(
        join_tiles(patches),
        variance,
        shifts,
        rolls,
        normals.sum(axis=0),
        _disagreement(normals, gradients, scenery.centres_px, rolling) * (1.0 + spent) / (1.0 - spent),
    )


def _blurred(coefficients: Floats) -> Floats:
    return np.asarray(convolve1d(convolve1d(coefficients, _BLUR, axis=-1), _BLUR, axis=-2))


def _disagreement(normals: Floats, gradients: Floats, places: Floats, rolling: bool) -> Floats:
    """Compare what parts of the scenery say against the common motion with their noise.

    The cluster-robust sandwich (Liang & Zeger 1986): neighbouring tiles share a codec's blocks and err together.
    """
    _, part = np.unique((places // _PART_PX).astype(int), axis=0, return_inverse=True)
    member = (part[:, None] == np.arange(part.max() + 1)).astype(float)
    free = free_parameters(rolling)
    ratios = []
    for normal, gradient in zip(normals.swapaxes(0, 1), gradients.swapaxes(0, 1), strict=True):
        step, covariance = solve_motion(normal.sum(axis=0), gradient.sum(axis=0), rolling)
        lower = np.linalg.cholesky(covariance[free, free])
        said = (member.T @ (gradient - normal @ step))[:, free] @ lower
        seen = np.count_nonzero(said.any(axis=1))
        ratios.append(said.T @ said * seen / max(seen - 2, 1))
    values, vectors = np.linalg.eigh(np.mean(ratios, axis=0))
    unlike = np.eye(3)
    unlike[free, free] = vectors @ np.diag(np.maximum(values, 1.0)) @ vectors.T
    return unlike
