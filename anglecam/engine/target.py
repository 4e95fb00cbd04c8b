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

Picture = NDArray[np.float32]
_ROUNDS = 2
"""Of visibility and background in turn."""
_MAD2 = 1.4826**2
_BORDER = 8
"""Pixels around what pictures show, beyond the reach of smoothing."""
_SHADE = 0.25
"""Usual change of a surface's brightness with the cosine of its turn before the light, as a share of it."""
_FAR = 2.5
"""Standard deviations beyond which a value has no more weight in a regression."""
_FEWEST_LIT = 8
"""Frames from which on a change with the light is sought: three means and a variance."""
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

    def predict(self, pose: Floats | None, light: Floats | None = None) -> tuple[Picture, Picture]:
        """Return the picture (h, w) for a pose (2, 3), or without the body, and its variance.

        ``light`` is that of `learn_target`, (2,); by default that of the pose.
        """
        if pose is None:
            return self.background, self.background_variance
        lit = self.appearance + np.tensordot(np.float32(pose[0, :2] if light is None else light), self.shading, 1)
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


def light_of(poses: Sequence[Floats | None]) -> Floats:
    """Return cosine and sine (K, 2) of the turns of poses (2, 3), as `learn_target` takes them."""
    return np.array([np.zeros(2) if pose is None else pose[0, :2] for pose in poses])


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
    sample: Sample, poses: Sequence[Floats | None], use: NDArray[np.int64], light: Floats | None = None
) -> Target:
    """Learn body and background from some frames of a sample.

    A matt surface under light that stands still is as bright as the cosine between its normal and the light. When it
    turns about the line of sight, this is a constant, a cosine and a sine of the turn, for every surface (Basri and
    Jacobs, IEEE Transactions on Pattern Analysis and Machine Intelligence 25, 2003, for the light instead).

    Parameters
    ----------
    sample : Sample
        K frames.
    poses : sequence of (2, 3) ndarray or None
        K maps from the coordinates of the body to the sample, px; ``None`` where the pose is unknown.
    use : (m,) ndarray of int
        Frames to learn from.
    light : (K, 2) ndarray, optional
        Cosine and sine of the turn before the light (`light_of`); by default the body is as bright in every pose.

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
    held = np.stack(
        [cv2.warpAffine(used[j], m, size, flags=back, borderValue=np.nan) for j, m in zip(known, maps, strict=True)]
    )
    lights = np.zeros((len(known), 2), np.float32) if light is None else np.asarray(light[use[known]], np.float32)
    shading = np.zeros((2, *part.shape), np.float32)
    visibility = part
    excess = sample.excesses[use]
    for step in range(_ROUNDS):
        if step and light is not None:
            # only of the body: the surroundings, too, change smoothly as it turns before them
            shading = _without_motion(_shading(held, lights, sample.noise) * visibility, appearance, variance)
        added = np.tensordot(lights, shading, 1)
        appearance, variance = _predicted(held - added, shading, sample.noise)
        behind = background_variance + sample.noise**2 + _FRACTION2 * _slope2(background)
        odds = np.ones(part.shape)
        for frame, lit, j, m in zip(held, appearance + added, known, maps, strict=True):
            # interpolation averages the noise of a frame, so that both are compared with the interpolated one
            here, spread = (cv2.warpAffine(one, m, size, flags=back) for one in (background, behind))
            multiply_odds(odds, frame, lit, variance, excess[j], here, spread)
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


def _shading(held: Picture, lights: Picture, noise: float) -> Picture:
    """Return what cosine and sine (m, 2) of the turn add to the pixels (m, …) of a body, (2, …) grey levels.

    It is nothing where a constant explains them as well, for the number of its parameters (Schwarz).
    """
    columns = np.ascontiguousarray(held.reshape(len(held), -1).T)
    median, variance = _typical(held)
    limit = np.sqrt(variance.ravel() + np.float32(noise**2))
    found = _regressed(columns, median.ravel(), limit, lights - lights.mean(axis=0), np.float32(_SHADE))
    return np.asarray(found.T.reshape(2, *held.shape[1:]))


def _without_motion(shading: Picture, appearance: Picture, variance: Picture) -> Picture:
    """Return a change with the light (2, …) without what a motion adds to a body's appearance.

    Where the centre is off, or the turns are, the body is displaced by a cosine and a sine of its turn: to first order
    by multiples of its slopes to the right, downwards and around. These are left to the poses.
    """
    lit = shading.any(axis=0)
    if not lit.any():
        return shading
    across, down = _slopes(appearance)
    y, x = np.indices(lit.shape)
    motions = np.stack([across, down, (x - x[lit].mean()) * down - (y - y[lit].mean()) * across])[:, lit]
    weight = 1.0 / np.sqrt(variance[lit])
    of_motion = np.linalg.lstsq((motions * weight).T, (shading[:, lit] * weight).T, rcond=None)[0]
    left = np.zeros_like(shading)
    left[:, lit] = shading[:, lit] - of_motion.T @ motions
    return left


@njit("float32[:, ::1](float32[:, ::1], float32[::1], float32[::1], float32[:, ::1], float32)", cache=True, nogil=True)
def _regressed(values, middle, spread, terms, shade):  # type: ignore[no-untyped-def]
    """Return the coefficients (n, 2) of terms (m, 2) in values (n, m), where they are worth it.

    Values that are off by more than `_FAR` times their spread count as if they were off by so much.
    """
    found = np.zeros((len(values), 2), np.float32)
    for i in range(len(values)):
        n, sx, sy, sr, sxx, sxy, syy, sxr, syr, srr = 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        far = _FAR * spread[i]
        for k in range(values.shape[1]):
            off = values[i, k] - middle[i]
            if not off * off >= 0.0:
                continue
            off = min(max(off, -far), far)
            x, y = terms[k, 0], terms[k, 1]
            n, sx, sy, sr = n + 1, sx + x, sy + y, sr + off
            sxx, sxy, syy = sxx + x * x, sxy + x * y, syy + y * y
            sxr, syr, srr = sxr + x * off, syr + y * off, srr + off * off
        if n < _FEWEST_LIT:
            continue
        prior = (spread[i] / (shade * max(middle[i], np.float32(1.0)))) ** 2
        sxx, sxy, syy = sxx - sx * sx / n + prior, sxy - sx * sy / n, syy - sy * sy / n + prior
        sxr, syr, srr = sxr - sx * sr / n, syr - sy * sr / n, srr - sr * sr / n
        determinant = sxx * syy - sxy * sxy
        a, b = (syy * sxr - sxy * syr) / determinant, (sxx * syr - sxy * sxr) / determinant
        left = srr - a * sxr - b * syr
        if left < srr * np.exp(-2.0 * np.log(n) / n):
            found[i, 0], found[i, 1] = a, b
    return found


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
    across, down = _slopes(picture)
    return np.asarray(across**2 + down**2)


def _slopes(picture: Picture) -> tuple[Picture, Picture]:
    """Return the gradient to the right and downwards, grey levels per px."""
    filled = np.nan_to_num(picture)
    across = cv2.Sobel(filled, cv2.CV_32F, 1, 0, scale=0.125)
    down = cv2.Sobel(filled, cv2.CV_32F, 0, 1, scale=0.125)
    return np.asarray(across), np.asarray(down)


def _onto_picture(pose: Floats, pad: int) -> Floats:
    """Return the (2, 3) map from the padded coordinates of the body to the picture."""
    return np.column_stack([pose[:, :2], pose[:, 2] - pose[:, :2] @ np.full(2, float(pad))])
