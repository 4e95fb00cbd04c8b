"""Learn a rigid body and its background from frames in which the body's poses are known.

What is seen is sorted into the coordinates of the body and those of the picture, in turn: a pixel belongs to the body
where the body explains it better than the background, and the background is what is seen beside the body.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats
from anglecam.engine.likelihood import multiply_odds
from anglecam.engine.sample import Sample
from anglecam.engine.shading import shading_of, slopes, without_motion
from anglecam.engine.target import Picture, Target, onto_picture
from anglecam.engine.typical import median_and_variance

_ROUNDS = 2
"""Of visibility and background in turn."""
_BORDER = 8
"""Pixels around what pictures show, beyond the reach of smoothing."""
_EVERY = 2
"""Pixels from each other at which it is first looked where the body may be."""
_REACH = 4
"""Pixels around these that are looked at then: the reach of smoothing."""
_BACK = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
_FRACTION2 = 1.0 / 12.0
"""Variance, px², of a place that is rounded to whole pixels."""


def learn_target(
    sample: Sample, poses: Sequence[Floats | None], use: NDArray[np.int64], *, lit: bool = False
) -> Target:
    """Learn body and background from some frames of a sample.

    Parameters
    ----------
    sample : Sample
        K frames.
    poses : sequence of (2, 3) ndarray or None
        K maps from the coordinates of the body to the sample, px; ``None`` where the pose is unknown.
    use : (m,) ndarray of int
        Frames to learn from.
    lit : bool
        Whether the brightness of the body changes with its turn before the light (`anglecam.engine.shading`).

    Returns
    -------
    Target
        Without a visible pixel where nothing follows the poses.
    """
    height, width = sample.pictures.shape[1:]
    pad = max(height, width) // 3
    used = sample.pictures[use]
    background, background_variance = sample.typical(use)
    known = [j for j, k in enumerate(use) if poses[k] is not None]
    maps = [onto_picture(pose, pad) for j in known if (pose := poses[use[j]]) is not None]
    blank = np.zeros((height + 2 * pad, width + 2 * pad), np.float32)
    excess = sample.excesses[use]
    behind = background_variance + sample.noise**2 + _FRACTION2 * _slope2(background)
    box = None
    if len(known) > 1:
        box = _sought(used[known], maps, excess[known], background, behind, sample.noise, blank.shape)
    if box is None:
        unlit = np.zeros((2, *blank.shape), np.float32)
        return Target(blank, unlit, blank, blank, background, behind, pad)
    maps = _within(maps, box)
    part = blank[box]
    size = part.shape[::-1]
    held = _held(used[known], maps, size)
    shading = np.zeros((2, *part.shape), np.float32)
    appearance, variance = _predicted(held, shading, sample.noise)
    shown: Sequence[Picture] = [appearance] * len(known)
    visibility = part
    for step in range(_ROUNDS):
        if step and lit:
            # only of the body: the surroundings, too, change smoothly as it turns before them
            lights = np.array([pose[0, :2] for j in known if (pose := poses[use[j]]) is not None], np.float32)
            shading = shading_of(held, *median_and_variance(held), lights, sample.noise) * visibility
            shading = without_motion(shading, appearance, variance)
            added = np.asarray(np.tensordot(lights, shading, 1), np.float32)
            appearance, variance = _predicted(held - added, shading, sample.noise)
            shown = list(appearance + added)
        behind = background_variance + sample.noise**2 + _FRACTION2 * _slope2(background)
        odds = _log_odds(held, shown, variance, excess[known], maps, background, behind)
        gain = cv2.GaussianBlur(odds, (0, 0), 1.0)
        # a pixel of the body has two parameters, mean and variance, or four (Schwarz, Annals of Statistics 6, 1978)
        least = np.log(len(known)) * np.where(shading.any(axis=0), 2.0, 1.0)
        seen = np.isfinite(appearance) & (gain > least)
        visibility = seen.astype(np.float32)
        cover = np.zeros(used.shape, np.float32)
        for j, m in zip(known, maps, strict=True):
            cover[j] = cv2.warpAffine(visibility, m, (width, height), flags=cv2.INTER_LINEAR)
        covered = (cover > 0.0).any(axis=0)
        bare = np.where(cover[:, covered] > 0.0, np.nan, used[:, covered])
        background, background_variance = background.copy(), background_variance.copy()
        background[covered], background_variance[covered] = median_and_variance(
            np.where(np.isfinite(bare).sum(axis=0) > 1, bare, used[:, covered])
        )
    behind = background_variance + sample.noise**2 + _FRACTION2 * _slope2(background)
    around = [(one.start, n - one.stop) for one, n in zip(box, blank.shape, strict=True)]
    seen_as, v, spread_of, *shades = (
        np.asarray(np.pad(np.nan_to_num(one), around), np.float32)
        for one in (appearance, visibility, variance, *shading)
    )
    return Target(seen_as, np.stack(shades), v, spread_of, background, behind, pad)


def _held(pictures: Picture, maps: Sequence[Floats], size: tuple[int, int]) -> Picture:
    """Return pictures (m, h, w) in the coordinates of the body, NaN where they do not show it."""
    back = (
        cv2.warpAffine(one, m, size, flags=_BACK, borderValue=np.nan) for one, m in zip(pictures, maps, strict=True)
    )
    return np.stack([np.asarray(one, np.float32) for one in back])


def _log_odds(
    held: Picture,
    means: Sequence[Picture],
    variance: Picture,
    excess: Picture,
    maps: Sequence[Floats],
    background: Picture,
    behind: Picture,
) -> Picture:
    """Return by how much the body is more probable than the background in each pixel of its coordinates, nats."""
    odds = np.ones(variance.shape)
    for frame, mean, more, m in zip(held, means, excess, maps, strict=True):
        # interpolation averages the noise of a frame, so that both are compared with the interpolated one
        here, spread = (cv2.warpAffine(one, m, variance.shape[::-1], flags=_BACK) for one in (background, behind))
        multiply_odds(odds, frame, mean, variance, more, here, spread)
    return np.log(odds).astype(np.float32)


def _sought(
    pictures: Picture,
    maps: Sequence[Floats],
    excess: Picture,
    background: Picture,
    behind: Picture,
    noise: float,
    padded: tuple[int, ...],
) -> tuple[slice, slice] | None:
    """Return rows and columns of the padded coordinates of the body among which its pixels are; ``None`` for none.

    Every other pixel of every other row is compared with the background.
    """
    box = _shown(maps, pictures.shape[1:], padded)
    sparse = [np.column_stack([_EVERY * m[:, :2], m[:, 2]]) for m in _within(maps, box)]
    size = tuple(-(-(one.stop - one.start) // _EVERY) for one in reversed(box))
    held = _held(pictures, sparse, size)
    appearance, variance = _predicted(held, np.zeros((2, *held.shape[1:]), np.float32), noise, _EVERY)
    odds = _log_odds(held, [appearance] * len(held), variance, excess, sparse, background, behind)
    rows, columns = np.nonzero(np.isfinite(appearance) & (odds > np.log(len(held))))
    if not len(rows):
        return None
    return _around(rows, box[0]), _around(columns, box[1])


def _around(at: NDArray[np.int64], of: slice) -> slice:
    """Return the pixels around some of every other pixel of a row or column."""
    first = of.start + _EVERY * int(at.min()) - _REACH
    return slice(max(of.start, first), min(of.stop, of.start + _EVERY * int(at.max()) + _REACH + 1))


def _within(maps: Sequence[Floats], box: tuple[slice, slice]) -> list[Floats]:
    """Return maps from the padded coordinates of the body as such from a part of them."""
    return [np.column_stack([m[:, :2], m @ [box[1].start, box[0].start, 1.0]]) for m in maps]


def _predicted(unlit: Picture, shading: Picture, noise: float, every: int = 1) -> tuple[Picture, Picture]:
    """Return the mean of a body's pixels (m, …), what the light adds taken out, and the variance of another value.

    The pixels are so many px from each other.
    """
    appearance, variance = median_and_variance(unlit)
    often = np.isfinite(unlit).sum(axis=0).astype(np.float32)
    # a mean and a variance from n values predict another one with the variance (n + 1)/(n − 1); from 3 they do not
    appearance = np.where(often > 3, appearance, np.nan)
    means = np.where(shading.any(axis=0), np.float32(3.0), np.float32(1.0))
    variance = variance * (often + means) / np.maximum(often - means, 1.0)
    return appearance, np.asarray(variance + noise**2 + _FRACTION2 * _slope2(appearance) / every**2, np.float32)


def _shown(maps: Sequence[Floats], shape: tuple[int, ...], padded: tuple[int, ...]) -> tuple[slice, slice]:
    """Return rows and columns of the padded coordinates of the body that pictures of a shape show in any pose."""
    height, width = shape
    corners = np.array([[0.0, 0.0], [width, 0.0], [0.0, height], [width, height]])
    places = np.concatenate([(corners - m[:, 2]) @ np.linalg.inv(m[:, :2]).T for m in maps])
    most = np.array(padded[::-1])
    low = np.clip(places.min(axis=0).astype(int) - _BORDER, 0, most - 1)
    high = np.clip(places.max(axis=0).astype(int) + _BORDER, low + 1, most)
    return slice(low[1], high[1]), slice(low[0], high[0])


def _slope2(picture: Picture) -> Picture:
    """Return the squared gradient, grey levels² per px²."""
    across, down = slopes(picture)
    return np.asarray(across**2 + down**2)
