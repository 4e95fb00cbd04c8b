"""A rigid body before a background: what it looks like, where it is, and what each frame then looks like.

    picture_k(x) = v(y)·a(y) + (1 − v(y))·b(x),     x = c + R(θ_k)(y − c)

a is the appearance in the coordinates of the body, v its visibility between 0 and 1, and b the background. All three
are learnt from frames whose poses are given. With them goes how far off they are, as a variance: where the surface
glitters or the pose is wrong, a pixel of the body differs from frame to frame.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats

Picture = NDArray[np.float32]


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
        onto = onto_picture(pose, self.pad)
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
        return cv2.warpAffine(self.visibility, onto_picture(pose, self.pad), (width, height)) > 0.0


def turned(centre: Floats, turn: float, shift: Floats | None = None) -> Floats:
    """Return the (2, 3) map of a body that is turned about a centre (2,), px, counter-clockwise as seen, rad."""
    cos, sin = math.cos(turn), math.sin(turn)
    x, y = float(centre[0]), float(centre[1])
    across, down = (0.0, 0.0) if shift is None else (float(shift[0]), float(shift[1]))
    return np.array([[cos, sin, x - (cos * x + sin * y) + across], [-sin, cos, y - (cos * y - sin * x) + down]])


def rotations(turn: Floats) -> tuple[Floats, Floats]:
    """Return the (n, 2, 2) matrices of turns (n,), rad, as in `turned`, and their derivatives."""
    cos, sin = np.cos(turn), np.sin(turn)
    both = np.empty((2, *np.shape(turn), 2, 2))
    for one, along, aside in ((both[0], cos, sin), (both[1], -sin, cos)):
        one[..., 0, 0] = one[..., 1, 1] = along
        one[..., 0, 1], one[..., 1, 0] = aside, -aside
    return both[0], both[1]


def onto_picture(pose: Floats, pad: int) -> Floats:
    """Return the (2, 3) map from the padded coordinates of the body to the picture."""
    return np.column_stack([pose[:, :2], pose[:, 2] - pose[:, :2] @ np.full(2, float(pad))])
