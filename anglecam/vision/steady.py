"""How the camera moved in every frame, from scenery that stands still.

What a tile of the scenery looks like between its pixels is learnt from a few frames as a fine spline
(`anglecam.vision.patch`): a camera that shakes puts its edges at a different place within the pixels in every frame.
Any other frame is followed roughly first (`anglecam.vision.scenery`); then its shift and roll are those at which
tiles and frame fit best, by Gauss and Newton. The frame is never interpolated, so nothing locks to the pixels.

How much more the tiles disagree than their noise would make them, direction by direction, widens the uncertainty.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve1d
from threadpoolctl import threadpool_limits

from anglecam.vision.patch import STEP_PX, Patches, Views, compare, learn_patch, levelled
from anglecam.vision.scenery import SIDE_PX, Image, Scenery, carried, find_scenery, follow, level, locate

Floats = NDArray[np.float64]

_TILES = 24
"""The most telling ones."""
_BLURRED_ROUNDS, _SHARP_ROUNDS = 2, 2
"""Of learning looks and motions in turn. A motion that is wrong by a function of its fraction of a pixel fits nearly as
well as the true one, by looks that are wobbly with the pixels' period; blurred looks cannot be."""
_BLUR = (0.25, 0.5, 0.25)
"""Of neighbouring knots, half a pixel apart: nothing of the pixels' period is left."""
_STEPS = 4
"""Of Gauss and Newton, at most; from a few hundredths of a pixel one is nearly enough."""
_SETTLED_PX = 5e-3
_HIDDEN = 3.0
"""Times its usual mean square that a tile misfits where something hides it."""
_PART_PX = 64
"""Of the picture, whose tiles are heard together about how much they disagree with others."""
_LEAST = 0.3
"""Of what the tiles tell in any direction, to be seen in a frame."""
_GAIN = 0.4
"""Most by which light changes."""
_SPOILT = 4.0
"""Times its usual mean square that all tiles may misfit in a frame."""
_RESTLESS = 5.0
"""Times the median misfit that a tile has in which something moves."""
_FEWEST = 8
"""Frames to learn from."""
_FEWEST_TILES = 4
_COPY = 0.13
"""What a codec's copies hide of a motion, as a share of that whose change of the picture equals the tiles' misfit (see
`anglecam.vision.register`); all tiles alike, so that they cannot tell."""
_ROLLS = 9.0
"""Mean square of the rolls in the frames learnt from, in units of their variance, from which on the camera rolls."""
_MARGIN_PX = 2
"""About a tile, so that a rolled one is seen whole."""


@dataclass(frozen=True)
class CameraMove:
    """How one frame's picture is displaced from the reference's: p' = origin + shift + R(roll)·(p − origin)."""

    origin_px: Floats
    """(2,) in the reference, px."""
    shift_px: Floats
    """(2,) px; NaN where the scenery is hidden."""
    roll: float
    """Counter-clockwise as seen, rad; 0 where the camera only shifts."""
    covariance: Floats
    """(3, 3) of shift, px, and roll, rad."""

    @property
    def known(self) -> bool:
        """Whether enough of the scenery was seen."""
        return bool(np.isfinite(self.shift_px).all())

    def to_frame(self, points_px: Floats) -> Floats:
        """Carry points (…, 2) of the reference into the frame."""
        return np.asarray((points_px - self.origin_px) @ _turned(self.roll) + self.origin_px + self.shift_px)

    def to_reference(self, points_px: Floats) -> Floats:
        """Carry points (…, 2) of the frame into the reference."""
        return np.asarray((points_px - self.origin_px - self.shift_px) @ _turned(-self.roll) + self.origin_px)

    def place_covariance(self, point_px: Floats) -> Floats:
        """Give the covariance (2, 2) of where the frame shows a point (2,) of the reference, px²."""
        x, y = point_px - self.origin_px
        J = np.array([[1.0, 0.0, y], [0.0, 1.0, -x]])
        return np.asarray(J @ self.covariance @ J.T)


LOST = CameraMove(np.zeros(2), np.full(2, np.nan), float("nan"), np.full((3, 3), np.nan))
"""Of a frame that shows nothing."""


@dataclass(frozen=True)
class Steady:
    """The scenery as it was learnt; the reference is where the first of the frames learnt from has it."""

    picture: Image
    """(h, w) the first frame, levelled."""
    scenery: Scenery
    """Only its best tiles."""
    patches: Patches
    """How they look."""
    variance: Floats
    """(tiles,) mean square of what each leaves over, grey levels squared."""
    rolls: bool
    """Whether the camera rolls more than can be chance."""
    unlike: Floats
    """(3, 3) ratio of the covariance of roll, x and y to what noise alone would make it, L: L·unlike·Lᵀ is the whole
    of what in noise would be L·Lᵀ; at least 1."""

    def at(self, image: Image, predicted: bool = False) -> CameraMove:
        """Find how a frame is displaced.

        Parameters
        ----------
        image : ndarray
            (h, w, 3) blue, green, red, or (h, w) brightness.
        predicted : bool
            Whether the codec made the frame from others.

        Returns
        -------
        CameraMove
            Unknown, its values NaN, where too little of the scenery is to be seen.
        """
        picture, origin = brightness(image), self.scenery.origin_px
        shift, roll = locate(self.scenery, follow(self.picture, level(picture), self.scenery.centres_px))
        if not np.isfinite(roll):
            return _lost(origin)
        roll = roll if self.rolls else 0.0
        cuts = _cut([picture], self.scenery, shift[None], np.array([roll]))
        rolls, origins = np.empty(len(self.patches)), np.broadcast_to(origin, (len(self.patches), 2))
        for _ in range(_STEPS):
            rolls[:] = roll
            views = _views(cuts.pixels[0] - origin - shift, cuts.values[0])
            fit = compare(self.patches, views, rolls, origins)
            # the edge of something else may fit in shape, not in strength
            seen = cuts.whole[0] & (fit.count > 0) & (np.abs(fit.light[:, 0, 0]) < _GAIN)
            if not seen.any():
                return _lost(origin)
            misfit = fit.squares / np.maximum(fit.count, 1) / self.variance
            # motion blur spoils all tiles alike, a passer-by only some
            usual = float(np.clip(np.median(misfit[seen]), 1.0, _SPOILT))
            seen &= misfit < _HIDDEN * usual
            normals, gradients = fit.weighted(self.variance * usual)
            normal = normals[seen].sum(axis=0)
            if np.linalg.eigvals(np.linalg.solve(normals.sum(axis=0)[1:, 1:], normal[1:, 1:])).min() < _LEAST:
                return _lost(origin)
            step, covariance = _solve(normal, gradients[seen].sum(axis=0), self.rolls)
            shift, roll = shift - step[1:] @ _turned(roll), roll + float(step[0])
            if np.abs(step[1:]).max() < _SETTLED_PX:
                break
        hidden = _COPY**2 * float(fit.count[seen].sum()) if predicted else 0.0
        lower = np.zeros((3, 3))
        free = _free(self.rolls)
        lower[free, free] = np.linalg.cholesky(covariance[free, free])
        turn = np.eye(3)
        turn[1:, 1:] = _turned(roll)
        covariance = turn.T @ lower @ (self.unlike + hidden * np.eye(3)) @ lower.T @ turn
        last = [1, 2, 0]
        return CameraMove(origin, shift, roll, covariance[np.ix_(last, last)])


def _lost(origin: Floats) -> CameraMove:
    return CameraMove(origin, np.full(2, np.nan), float("nan"), np.full((3, 3), np.nan))


def shakes(images: Sequence[Image]) -> bool:
    """Tell from frames spread over a clip whether its camera shakes.

    Parameters
    ----------
    images : sequence of ndarray
        (h, w, 3) blue, green, red.

    Returns
    -------
    bool
        In doubt not.
    """
    scenery = find_scenery([brightness(image) for image in images])
    return scenery is not None and scenery.shakes


def learn_steady(images: Sequence[Image]) -> Steady | None:
    """Learn the scenery where the camera does not stand still.

    Parameters
    ----------
    images : sequence of ndarray
        (h, w, 3) blue, green, red, spread over a clip; some thirty.

    Returns
    -------
    Steady or None
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


def brightness(image: Image) -> Image:
    """Weigh blue, green, red (h, w, 3) into grey (h, w): what codecs store at full resolution."""
    planes = 1 if image.ndim == 2 else image.shape[2]
    return image.reshape(image.shape[:2]) if planes == 1 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)


@dataclass(frozen=True)
class _Cuts:
    """What frames show of the tiles, and a little around them."""

    pixels: Floats
    """(frames, tiles, m, 2) px."""
    values: NDArray[np.float32]
    """(frames, tiles, m)."""
    whole: NDArray[np.bool_]
    """(frames, tiles) whether all of it is in the picture."""


@dataclass(frozen=True)
class _Learnt:
    patches: Patches
    variance: Floats
    shifts_px: Floats
    rolls: Floats
    normal: Floats
    """(frames, 3, 3) of roll, x and y, over the variances."""
    unlike: Floats


def _learn(scenery: Scenery, pictures: Sequence[Image], shifts: Floats, rolls: Floats) -> Steady | None:
    """Learn with rolls; then, where these are chance, without, and without the tiles in which something moves."""
    tiles = _part_of(
        scenery, _most_telling(scenery, pictures[0].shape[1::-1], np.quantile(np.abs(shifts), 0.7, axis=0))
    )
    if len(tiles.centres_px) < _FEWEST_TILES:
        return None
    cuts = _cut(pictures, tiles, shifts, rolls)
    learnt = _in_turn(cuts, tiles, shifts, rolls, rounds=_BLURRED_ROUNDS, sharp=0, rolling=True)
    by_roll = 1.0 / np.linalg.inv(learnt.normal)[:, 0, 0]
    rolling = bool(np.var(learnt.rolls) * by_roll.mean() > _ROLLS * learnt.unlike[0, 0])
    tiles = _part_of(tiles, np.flatnonzero(learnt.variance < _RESTLESS * np.median(learnt.variance)))
    shifts, rolls = learnt.shifts_px, learnt.rolls if rolling else 0.0 * rolls
    cuts = _cut(pictures, tiles, shifts, rolls)
    rounds = _BLURRED_ROUNDS + _SHARP_ROUNDS
    learnt = _in_turn(cuts, tiles, shifts, rolls, rounds=rounds, sharp=_SHARP_ROUNDS, rolling=rolling)
    return Steady(level(pictures[0]), tiles, learnt.patches, learnt.variance, rolling, learnt.unlike)


def _most_telling(scenery: Scenery, size: tuple[int, ...], reach_px: Floats) -> NDArray[np.intp]:
    """Choose the windows, mostly whole in the picture, that together tell most, in the worst direction too."""
    border = SIDE_PX / 2.0 + _MARGIN_PX + reach_px
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
    cuts: _Cuts, scenery: Scenery, shifts: Floats, rolls: Floats, *, rounds: int, sharp: int, rolling: bool
) -> _Learnt:
    """Learn looks and motions in turn."""
    origin, corners = scenery.origin_px, scenery.centres_px - SIDE_PX / 2.0
    clear = cuts.whole.copy()
    # of the frames' own noise the looks have learnt this share by heart
    spent = 1.0 / (STEP_PX**2 * len(shifts))
    light: list[Floats | None] = [None] * len(corners)
    patches: list[Patches] = []
    for left in reversed(range(rounds)):
        offsets = cuts.pixels - (origin + shifts)[:, None, None]
        patches, fits = [], []
        for t, corner in enumerate(corners):
            own = light[t]
            views = _views(offsets[clear[:, t], t], cuts.values[clear[:, t], t])
            views = views if own is None else levelled(views, own[clear[:, t]])
            look = learn_patch(corner, SIDE_PX, views, rolls[clear[:, t]], origin)
            # light does not fall otherwise on scenery
            look = replace(look, gains=0.0 * look.gains)
            if left >= sharp:
                look = replace(look, coefficients=_blurred(look.coefficients))
            patches.append(look)
            fits.append(compare(look, _views(offsets[:, t], cuts.values[:, t]), rolls, origin[None]))
            light[t] = fits[-1].light
        mean_square = np.stack([f.squares / np.maximum(f.count, 1) for f in fits])
        usual = np.median(mean_square, axis=1)
        clear = cuts.whole & (mean_square < _HIDDEN * usual[:, None]).T
        variance = np.array([m[ok].mean() for m, ok in zip(mean_square, clear.T, strict=True)]) / (1.0 - spent)
        weight = clear.T / variance[:, None]
        normals = np.stack([f.normal for f in fits]) * weight[..., None, None]
        gradients = np.stack([f.gradient for f in fits]) * weight[..., None]
        if left:
            together = zip(normals.sum(axis=0), gradients.sum(axis=0), strict=True)
            steps = np.array([_solve(*one, rolling)[0] for one in together])
            shifts = shifts - np.array([s[1:] @ _turned(roll) for s, roll in zip(steps, rolls, strict=True)])
            rolls = rolls + steps[:, 0]
    return _Learnt(
        Patches(
            corners,
            SIDE_PX,
            np.concatenate([p.coefficients for p in patches]),
            np.concatenate([p.gains for p in patches]),
        ),
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
    free = _free(rolling)
    ratios = []
    for normal, gradient in zip(normals.swapaxes(0, 1), gradients.swapaxes(0, 1), strict=True):
        step, covariance = _solve(normal.sum(axis=0), gradient.sum(axis=0), rolling)
        lower = np.linalg.cholesky(covariance[free, free])
        said = (member.T @ (gradient - normal @ step))[:, free] @ lower
        seen = np.count_nonzero(said.any(axis=1))
        ratios.append(said.T @ said * seen / max(seen - 2, 1))
    values, vectors = np.linalg.eigh(np.mean(ratios, axis=0))
    unlike = np.eye(3)
    unlike[free, free] = vectors @ np.diag(np.maximum(values, 1.0)) @ vectors.T
    return unlike


def _free(rolling: bool) -> slice:
    """Say which of roll, x and y are looked for."""
    return slice(0 if rolling else 1, 3)


def _solve(normal: Floats, gradient: Floats, rolling: bool) -> tuple[Floats, Floats]:
    """Solve for roll, x and y of the tiles' places, or for x and y alone; return the covariance too."""
    free = _free(rolling)
    step, covariance = np.zeros(3), np.zeros((3, 3))
    covariance[free, free] = np.linalg.inv(normal[free, free])
    step[free] = covariance[free, free] @ gradient[free]
    return step, covariance


def _cut(pictures: Sequence[Image], scenery: Scenery, shifts: Floats, rolls: Floats) -> _Cuts:
    """Cut squares out of the frames, each by whole pixels about where its tile is."""
    side = SIDE_PX + 2 * _MARGIN_PX
    y, x = np.mgrid[0:side, 0:side].reshape(2, -1)
    height, width = pictures[0].shape
    arms = scenery.centres_px - scenery.origin_px
    middles = scenery.centres_px + carried(arms, shifts, rolls).swapaxes(0, 1)
    corners = np.round(middles - (side - 1) / 2.0).astype(int)
    whole = np.all((corners >= 0) & (corners <= [width - side, height - side]), axis=-1)
    corners = np.clip(corners, 0, [width - side, height - side])
    pixels = corners[:, :, None] + np.stack([x, y], axis=-1)
    values = np.stack([p[at[..., 1], at[..., 0]] for p, at in zip(pictures, pixels, strict=True)])
    return _Cuts(pixels.astype(float), values.astype(np.float32), whole)


def _views(offsets: Floats, values: NDArray[np.float32]) -> Views:
    count, each = values.shape
    return Views(offsets.reshape(-1, 2), values.reshape(-1, 1), np.arange(count + 1) * each)


def _turned(roll: float) -> Floats:
    """Return the matrix M with which v @ M is v turned counter-clockwise as seen, y down."""
    c, s = np.cos(roll), np.sin(roll)
    return np.array([[c, -s], [s, c]])
