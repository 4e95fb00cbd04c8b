"""A rigid body before a background: what it looks like, where it is, and what each frame then looks like.

    picture_k(x) = v(y)·a(y) + (1 − v(y))·b(x),     x = c + R(θ_k)(y − c)

a is the appearance in the coordinates of the body, v its visibility between 0 and 1, and b the background. All three
are learnt from frames whose poses are given. With them goes how far off they are, as a variance: where the surface
glitters or the pose is wrong, a pixel of the body differs from frame to frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from anglecam.data.typing import Floats
from anglecam.engine.likelihood import multiply_odds
from anglecam.engine.sample import Sample
from anglecam.engine.shading import shading_of, slopes, without_motion

Picture = NDArray[np.float32]
_ROUNDS = 2
"""Of visibility and background in turn."""
_MAD2 = 1.4826**2
_BORDER = 8
"""Pixels around what pictures show, beyond the reach of smoothing."""
_FRACTION2 = 1.0 / 12.0
"""Variance, px², of a place that is rounded to whole pixels."""


@dataclass(frozen=True)
class Target:
    """A body and its background, of one sample."""

    appearance: Picture = field(repr=False)
    """(H, W) a, grey levels, in the coordinates of the body."""
    shading: Picture = field(repr=False)
    """(2, H, W) grey levels that the cosine and the sine of its turn add to it."""
    visibility: Picture = field(repr=False)
    """(H, W) v."""
    variance: Picture = field(repr=False)
    """(H, W) of the body's pixels, grey levels²."""
    background: Picture = field(repr=False)
    """(h, w) b, grey levels."""
    background_variance: Picture = field(repr=False)
    """(h, w) grey levels²."""
    pad: int
    """Pixels by which the coordinates of the body reach beyond the picture."""

    def predict(self, pose: Floats | None) -> tuple[Picture, Picture]:
        """Return the picture (h, w) for a pose (2, 3), or without the body, and its variance."""
        if pose is None:
            return self.background, self.background_variance
        lit = self.appearance + np.tensordot(np.float32(pose[0, :2]), self.shading, 1)
        height, width = self.background.shape
        onto = _onto_picture(pose, self.pad)
        seen = cv2.warpAffine(self.visibility, onto, (width, height), flags=cv2.INTER_LINEAR)
        body = cv2.warpAffine(self.visibility * lit, onto, (width, height), flags=cv2.INTER_LINEAR)
        spread = cv2.warpAffine(self.visibility * self.variance, onto, (width, height), flags=cv2.INTER_LINEAR)
        return (
            np.asarray(body + (1.0 - seen) * self.background),
            np.asarray(spread + (1.0 - seen) * self.background_variance),
        )

    def covers(self, pose: Floats) -> NDArray[np.bool_]:
        """Return (h, w) whether the body in a pose covers a pixel of the picture, or a part of it."""
        height, width = self.background.shape
        return cv2.warpAffine(self.visibility, _onto_picture(pose, self.pad), (width, height)) > 0.0


def turned(centre: Floats, turn: float, shift: Floats | None = None) -> Floats:
    """Return the (2, 3) map of a body that is turned about a centre (2,), px, counter-clockwise as seen, rad."""
    cos, sin = np.cos(turn), np.sin(turn)
    rotation = np.array([[cos, sin], [-sin, cos]])
    at = np.asarray(centre, float)
    offset = at - rotation @ at + (0.0 if shift is None else shift)
    return np.column_stack([rotation, offset])


def rotations(turn: Floats) -> tuple[Floats, Floats]:
    """Return the (n, 2, 2) matrices of turns (n,), rad, as in `turned`, and their derivatives."""
    cos, sin = np.cos(turn), np.sin(turn)
    return (
        np.stack([np.stack([cos, sin], -1), np.stack([-sin, cos], -1)], 1),
        np.stack([np.stack([-sin, cos], -1), np.stack([-cos, -sin], -1)], 1),
    )


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
    background, background_variance = _typical(used)
    known = [j for j, k in enumerate(use) if poses[k] is not None]
    blank = np.zeros((height + 2 * pad, width + 2 * pad), np.float32)
    if len(known) < 2:
        behind = background_variance + sample.noise**2 + _FRACTION2 * _slope2(background)
        unlit = np.zeros((2, *blank.shape), np.float32)
        return Target(blank, unlit, blank, blank, background, behind, pad)
    maps = [_onto_picture(pose, pad) for j in known if (pose := poses[use[j]]) is not None]
    box = _shown(maps, (height, width), blank.shape)
    maps = [np.column_stack([m[:, :2], m @ [box[1].start, box[0].start, 1.0]]) for m in maps]
    part = blank[box]
    size = part.shape[::-1]
    back = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    seen_in = (
        cv2.warpAffine(used[j], m, size, flags=back, borderValue=np.nan) for j, m in zip(known, maps, strict=True)
    )
    held = np.stack([np.asarray(one, np.float32) for one in seen_in])
    shading = np.zeros((2, *part.shape), np.float32)
    appearance, variance = _predicted(held, shading, sample.noise)
    shown: Sequence[Picture] = [appearance] * len(known)
    visibility = part
    excess = sample.excesses[use]
    for step in range(_ROUNDS):
        if step and lit:
            # only of the body: the surroundings, too, change smoothly as it turns before them
            lights = np.array([pose[0, :2] for j in known if (pose := poses[use[j]]) is not None], np.float32)
            shading = shading_of(held, *_typical(held), lights, sample.noise) * visibility
            shading = without_motion(shading, appearance, variance)
            added = np.asarray(np.tensordot(lights, shading, 1), np.float32)
            appearance, variance = _predicted(held - added, shading, sample.noise)
            shown = list(appearance + added)
        behind = background_variance + sample.noise**2 + _FRACTION2 * _slope2(background)
        odds = np.ones(part.shape)
        for frame, mean, j, m in zip(held, shown, known, maps, strict=True):
            # interpolation averages the noise of a frame, so that both are compared with the interpolated one
            here, spread = (cv2.warpAffine(one, m, size, flags=back) for one in (background, behind))
            multiply_odds(odds, frame, mean, variance, excess[j], here, spread)
        gain = cv2.GaussianBlur(np.log(odds).astype(np.float32), (0, 0), 1.0)
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
        background[covered], background_variance[covered] = _typical(
            np.where(np.isfinite(bare).sum(axis=0) > 1, bare, used[:, covered])
        )
    behind = background_variance + sample.noise**2 + _FRACTION2 * _slope2(background)
    around = [(one.start, n - one.stop) for one, n in zip(box, blank.shape, strict=True)]
    seen_as, v, spread_of, *shades = (
        np.asarray(np.pad(np.nan_to_num(one), around), np.float32)
        for one in (appearance, visibility, variance, *shading)
    )
    return Target(seen_as, np.stack(shades), v, spread_of, background, behind, pad)


def _predicted(unlit: Picture, shading: Picture, noise: float) -> tuple[Picture, Picture]:
    """Return the mean of a body's pixels (m, …), what the light adds taken out, and the variance of another value."""
    appearance, variance = _typical(unlit)
    often = np.isfinite(unlit).sum(axis=0).astype(np.float32)
    # a mean and a variance from n values predict another one with the variance (n + 1)/(n − 1); from 3 they do not
    appearance = np.where(often > 3, appearance, np.nan)
    means = np.where(shading.any(axis=0), np.float32(3.0), np.float32(1.0))
    variance = variance * (often + means) / np.maximum(often - means, 1.0)
    return appearance, np.asarray(variance + noise**2 + _FRACTION2 * _slope2(appearance), np.float32)


def _shown(maps: list[Floats], shape: tuple[int, ...], padded: tuple[int, ...]) -> tuple[slice, slice]:
    """Return rows and columns of the padded coordinates of the body that pictures of a shape show in any pose."""
    height, width = shape
    corners = np.array([[0.0, 0.0], [width, 0.0], [0.0, height], [width, height]])
    places = np.concatenate([(corners - m[:, 2]) @ np.linalg.inv(m[:, :2]).T for m in maps])
    most = np.array(padded[::-1])
    low = np.clip(places.min(axis=0).astype(int) - _BORDER, 0, most - 1)
    high = np.clip(places.max(axis=0).astype(int) + _BORDER, low + 1, most)
    return slice(low[1], high[1]), slice(low[0], high[0])


def _typical(pictures: Picture) -> tuple[Picture, Picture]:
    """Return the median of (m, …) pictures and the robust variance about it, where NaN is unknown; NaN for none."""
    columns = np.ascontiguousarray(pictures.reshape(len(pictures), -1).T)
    columns.sort(axis=-1)  # NaN comes last
    median, variance = _of_ordered(columns)
    return median.reshape(pictures.shape[1:]), variance.reshape(pictures.shape[1:])


@njit("UniTuple(float32[::1], 2)(float32[:, ::1])", cache=True, nogil=True)
def _of_ordered(ordered):  # type: ignore[no-untyped-def]
    """Return medians (n,) of ordered values (n, m), and the variance by the median of the distances from them.

    On either side of the median the values are in the order of their distance; so the nearest half is found by going
    outwards.
    """
    median, variance = np.full(len(ordered), np.nan, np.float32), np.full(len(ordered), np.nan, np.float32)
    for i in range(len(ordered)):
        count = ordered.shape[1]
        while count > 0 and np.isnan(ordered[i, count - 1]):
            count -= 1
        if count == 0:
            continue
        middle = np.float32(0.5) * (ordered[i, (count - 1) // 2] + ordered[i, count // 2])
        above = count // 2
        below, far, before = above - 1, np.float32(0.0), np.float32(0.0)
        for _ in range(count // 2 + 1):
            before = far
            down = middle - ordered[i, below] if below >= 0 else np.float32(np.inf)
            up = ordered[i, above] - middle if above < count else np.float32(np.inf)
            if down < up:
                far, below = down, below - 1
            else:
                far, above = up, above + 1
        deviation = far if count % 2 else np.float32(0.5) * (before + far)
        median[i], variance[i] = middle, np.float32(_MAD2) * deviation * deviation
    return median, variance


def _slope2(picture: Picture) -> Picture:
    """Return the squared gradient, grey levels² per px²."""
    across, down = slopes(picture)
    return np.asarray(across**2 + down**2)


def _onto_picture(pose: Floats, pad: int) -> Floats:
    """Return the (2, 3) map from the padded coordinates of the body to the picture."""
    return np.column_stack([pose[:, :2], pose[:, 2] - pose[:, :2] @ np.full(2, float(pad))])
