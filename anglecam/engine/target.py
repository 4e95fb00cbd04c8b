"""A rigid body before a background: what it looks like, where it is, and what each frame then looks like.

    picture_k(x) = v(y)·a(y) + (1 − v(y))·b(x),     x = c + R(θ_k)(y − c)

a is the appearance in the coordinates of the body, v its visibility between 0 and 1, and b the background. All three
are learnt from frames whose poses are given. With them goes how far off they are, as a variance: where the surface
glitters or the pose is wrong, a pixel of the body differs from frame to frame.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats
from anglecam.engine.likelihood import log_density
from anglecam.engine.sample import Sample

Picture = NDArray[np.float32]
_ROUNDS = 2
"""Of visibility and background in turn."""
_MAD2 = 1.4826**2
_FRACTION2 = 1.0 / 12.0
"""Variance, px², of a place that is rounded to whole pixels."""


@dataclass(frozen=True)
class Target:
    """A body and its background, of one sample."""

    appearance: Picture = field(repr=False)
    """(H, W) a, grey levels, in the coordinates of the body."""
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
        height, width = self.background.shape
        onto = _onto_picture(pose, self.pad)
        seen = cv2.warpAffine(self.visibility, onto, (width, height), flags=cv2.INTER_LINEAR)
        body = cv2.warpAffine(self.visibility * self.appearance, onto, (width, height), flags=cv2.INTER_LINEAR)
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


def learn_target(sample: Sample, poses: list[Floats | None], use: NDArray[np.int64]) -> Target:
    """Learn body and background from some frames of a sample.

    Parameters
    ----------
    sample : Sample
        K frames.
    poses : list of (2, 3) ndarray or None
        K maps from the coordinates of the body to the sample, px; ``None`` where the pose is unknown.
    use : (m,) ndarray of int
        Frames to learn from.

    Returns
    -------
    Target
        Without a visible pixel where nothing follows the poses.
    """
    height, width = sample.pictures.shape[1:]
    pad = max(height, width) // 3
    size = (width + 2 * pad, height + 2 * pad)
    used = sample.pictures[use]
    background, background_variance = _typical(used)
    known = [j for j, k in enumerate(use) if poses[k] is not None]
    blank = np.zeros(size[::-1], np.float32)
    if len(known) < 2:
        behind = background_variance + sample.noise**2 + _FRACTION2 * _slope2(background)
        return Target(blank, blank, blank, background, behind, pad)
    maps = [_onto_picture(pose, pad) for j in known if (pose := poses[use[j]]) is not None]
    back = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    held = np.stack(
        [cv2.warpAffine(used[j], m, size, flags=back, borderValue=np.nan) for j, m in zip(known, maps, strict=True)]
    )
    appearance, variance = _typical(held.astype(np.float32))
    often = np.isfinite(held).sum(axis=0).astype(np.float32)
    # a mean and a variance from n values predict another one with the variance (n + 1)/(n − 1); from 3 they do not
    appearance = np.where(often > 3, appearance, np.nan)
    variance = variance * (often + 1.0) / np.maximum(often - 1.0, 1.0)
    variance = variance + sample.noise**2 + _FRACTION2 * _slope2(appearance)
    visibility = blank
    excess = sample.excesses[use]
    for _ in range(_ROUNDS):
        behind = background_variance + sample.noise**2 + _FRACTION2 * _slope2(background)
        gain = blank.copy()
        for frame, j, m in zip(held, known, maps, strict=True):
            # interpolation averages the noise of a frame, so that both are compared with the interpolated one
            here, spread = (cv2.warpAffine(one, m, size, flags=back) for one in (background, behind))
            as_body = log_density(frame, appearance, variance + excess[j])
            as_background = log_density(frame, here, spread + excess[j])
            gain += np.where(np.isfinite(frame), as_body - as_background, 0.0)
        # a pixel of the body has two parameters, mean and variance (Schwarz, Annals of Statistics 6, 1978)
        seen = np.isfinite(appearance) & (cv2.GaussianBlur(gain, (0, 0), 1.0) > np.log(len(known)))
        visibility = seen.astype(np.float32)
        cover = np.zeros(used.shape, np.float32)
        for j, m in zip(known, maps, strict=True):
            cover[j] = cv2.warpAffine(visibility, m, (width, height), flags=cv2.INTER_LINEAR)
        covered = (cover > 0.0).any(axis=0)
        part = np.where(cover[:, covered] > 0.0, np.nan, used[:, covered])
        background, background_variance = background.copy(), background_variance.copy()
        background[covered], background_variance[covered] = _typical(
            np.where(np.isfinite(part).sum(axis=0) > 1, part, used[:, covered])
        )
    behind = background_variance + sample.noise**2 + _FRACTION2 * _slope2(background)
    return Target(np.nan_to_num(appearance), visibility, np.nan_to_num(variance), background, behind, pad)


def _typical(pictures: Picture) -> tuple[Picture, Picture]:
    """Return the median of (m, …) pictures and the robust variance about it, where NaN is unknown; NaN for none."""
    stack = np.ascontiguousarray(np.moveaxis(pictures, 0, -1))
    median = _median(stack)
    return median, np.asarray(_MAD2 * _median(np.abs(stack - median[..., None])) ** 2)


def _median(stack: Picture) -> Picture:
    """Return the median over the last axis; NumPy sorts NaN to the end."""
    ordered = np.sort(stack, axis=-1)
    known = np.isfinite(ordered).sum(axis=-1, keepdims=True)
    low, high = np.maximum(known - 1, 0) // 2, np.minimum(known // 2, stack.shape[-1] - 1)
    middle = np.take_along_axis(ordered, low, -1) + np.take_along_axis(ordered, high, -1)
    return np.asarray(np.where(known > 0, 0.5 * middle, np.nan)[..., 0], dtype=np.float32)


def _slope2(picture: Picture) -> Picture:
    """Return the squared gradient, grey levels² per px²."""
    filled = np.nan_to_num(picture)
    across = cv2.Sobel(filled, cv2.CV_32F, 1, 0, scale=0.125)
    down = cv2.Sobel(filled, cv2.CV_32F, 0, 1, scale=0.125)
    return np.asarray(across**2 + down**2)


def _onto_picture(pose: Floats, pad: int) -> Floats:
    """Return the (2, 3) map from the padded coordinates of the body to the picture."""
    return np.column_stack([pose[:, :2], pose[:, 2] - pose[:, :2] @ np.full(2, float(pad))])
