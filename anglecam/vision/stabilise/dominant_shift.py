"""The shift of a camera that predicts most of the edges of the scenery.

It is found by robust direct estimation through a pyramid of reduced pictures (Odobez and Bouthemy 1995): pixels that do
not follow have no weight. What turns before a plain wall may have most of the edges; but it follows a shift in few
pictures. So pixels are weighted by how often they follow, and the shifts are found again.

It needs neither corners nor a texture, which `anglecam.vision.stabilise.learn` does; its shifts are less accurate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np

from anglecam.data.typing import Floats, Image
from anglecam.vision.stabilise.background_motion import BackgroundMotion, CameraMove
from anglecam.vision.stabilise.scenery_edges import Level, SceneryEdges, values_at

_TUKEY = 4.685
"""Standard deviations from which on a pixel has no weight (95 % efficient for normal errors)."""
_STEPS, _SETTLED_PX = 12, 0.01
"""Gauss-Newton steps at each level, at most, and the step below which they end."""
_ROUNDS = 3
"""Rounds of shifts and of weights by how often a pixel follows."""
_STARTS, _APART_PX = 3, 1.0
"""Shifts from which the coarsest level is climbed, at most, and the distance at which two are one, px."""
_SPREAD_PX = 0.6
"""Standard deviation, in pixels of a level, by which those weights are spread to its pixels."""
_PART_PX = 32
"""Side, px, of the parts of the picture whose pixels have errors of their own."""
_STILL_PX = 0.1
"""RMS shift, px of the film, up to which the camera counts as at rest: interpolation would cost as much."""
_INTERPOLATION_PX = 0.04
"""Standard deviation by which linear interpolation shifts all edges alike, px of the reduced picture: it depends on the
fraction of a pixel. No part contradicts it."""
_LEAST_SEEN = 0.5
"""Least weight of the pixels that follow in a frame, relative to the usual one. In others the scenery is hidden."""


@dataclass(frozen=True, eq=False)
class ShiftingScenery:
    """Scenery that only shifts before the camera. The reference is the first picture from which it was learnt."""

    edges: SceneryEdges = field(repr=False)
    weights: list[Floats] = field(repr=False)
    """Of each level's pixels (n,)."""
    usual: float
    """Weight of the pixels that follow in most frames."""
    shifts_px: Floats = field(repr=False)
    """(frames, 2) of the pictures, px of the film."""

    def at(self, image: Image, predicted: bool = False) -> CameraMove:
        """Measure the displacement of a frame.

        Parameters
        ----------
        image : ndarray
            (h, w, 3) blue, green, red, or (h, w[, 1]) brightness.
        predicted : bool
            Whether the codec predicted the frame; the parts' disagreement contains what that does.

        Returns
        -------
        CameraMove
            Unknown, with NaN values, where too little of the scenery is visible.
        """
        scale, origin = self.edges.to_reduced[0, 0], np.zeros(2)
        pyramid = self.edges.pyramid(image)
        shift, fits = _shift(self.edges, pyramid, scale * self.shifts_px, self.weights)
        if float(self.weights[-1] @ fits) < _LEAST_SEEN * self.usual:
            return CameraMove(origin, np.full(2, np.nan), float("nan"), np.full((3, 3), np.nan))
        covariance = np.zeros((3, 3))
        covariance[:2, :2] = _covariance(pyramid[-1], self.edges, self.weights[-1], shift) / scale**2
        return CameraMove(origin, shift / scale, 0.0, covariance)


CameraMotion = BackgroundMotion | ShiftingScenery
"""By which the camera's motion is measured in a frame."""


def learn_shift(edges: SceneryEdges, images: Sequence[Image]) -> ShiftingScenery | None:
    """Learn scenery that shifts.

    Parameters
    ----------
    edges : SceneryEdges
        Of the first picture.
    images : sequence of ndarray
        (h, w, 3) blue, green, red, spread over a clip, in the order of time; around thirty.

    Returns
    -------
    ShiftingScenery or None
        ``None`` where a camera at rest predicts the pictures as well.
    """
    pyramids = [edges.pyramid(image) for image in images]
    follows, shifts = np.ones(len(edges.levels[-1].values)), np.zeros((len(images), 2))
    for _ in range(_ROUNDS):
        weights, fits = _weights(edges, follows), []
        for k, pyramid in enumerate(pyramids):
            shifts[k], fitted = _shift(
                edges, pyramid, np.array([shifts[max(k - 1, 0)], np.zeros(2), shifts[k]]), weights
            )
            fits.append(fitted)
        follows = np.mean(fits, axis=0)
    shifts_px = shifts / edges.to_reduced[0, 0]
    if np.sqrt(shifts_px.var(axis=0).sum()) < _STILL_PX:
        return None
    moves, rest = [shift_of(one) for one in shifts_px], [np.eye(3)] * len(images)
    if not edges.is_scenery(edges.gain(images, moves, rest), edges.gain_if_right(moves, rest)):
        return None
    weights = _weights(edges, follows)
    return ShiftingScenery(edges, weights, float(np.median([weights[-1] @ one for one in fits])), shifts_px)


def shift_of(shift_px: Floats) -> Floats:
    """Return the homography (3, 3) of a shift (2,), px."""
    move = np.eye(3)
    move[:2, 2] = shift_px
    return move


def _weights(edges: SceneryEdges, follows: Floats) -> list[Floats]:
    """Return the weights of each level's pixels, the square of how often the finest pixels beside them follow."""
    width, height = edges.size
    often, there = np.zeros((height, width), np.float32), np.zeros((height, width), np.float32)
    often[_index(edges, edges.levels[-1])], there[_index(edges, edges.levels[-1])] = follows, 1.0
    weights = []
    for level in edges.levels:
        spread = _SPREAD_PX * level.reduction
        mean = cv2.GaussianBlur(often, (0, 0), spread) / np.maximum(cv2.GaussianBlur(there, (0, 0), spread), 1e-3)
        weights.append(np.asarray(mean[_index(edges, level)], dtype=float) ** 2)
    return weights


def _index(edges: SceneryEdges, level: Level) -> tuple[np.ndarray, np.ndarray]:
    column, row = (level.places + np.array(edges.size) / 2.0).round().astype(int).T
    return row.clip(0, edges.size[1] - 1), column.clip(0, edges.size[0] - 1)


def _shift(edges: SceneryEdges, pyramid: list[Image], starts: Floats, weights: list[Floats]) -> tuple[Floats, Floats]:
    """Return the shift (2,), px of the reduced picture, and how well each pixel of the finest level follows it (n,)."""
    coarsest, weight = edges.levels[0], weights[0]
    places = np.unique(np.round(starts / _APART_PX), axis=0, return_index=True)[1]
    fits = [
        weight @ _fits(values_at(pyramid[0], coarsest.places + starts[k], edges.size), coarsest, weight)[1]
        for k in places
    ]
    tried = [starts[places[k]] for k in np.argsort(-np.array(fits), kind="stable")[:_STARTS]]
    for level, picture, weight in zip(edges.levels, pyramid, weights, strict=True):
        found = [_climb(picture, level, weight, start, edges.size) for start in tried]
        found.sort(key=lambda one: -float(weight @ one[1]))
        tried = [shift for shift, _ in found[: (len(found) + 1) // 2]]  # the finest level is the dearest
    return found[0]


def _covariance(picture: Image, edges: SceneryEdges, weight: Floats, shift: Floats) -> Floats:
    """Return the covariance (2, 2), px² of the reduced picture, from what parts of the scenery contradict each other.

    The sandwich estimate (Liang and Zeger 1986): pixels beside each other have the same errors.
    """
    level = edges.levels[-1]
    seen = values_at(picture, level.places + shift, edges.size)
    contrast, fits = _fits(seen, level, weight)
    each = (weight * fits / level.sigma**2)[:, None] * level.slopes * contrast
    bread = np.linalg.inv(each.T @ level.slopes * contrast + 1e-9 * np.eye(2))
    _, part = np.unique((level.places // _PART_PX).astype(int), axis=0, return_inverse=True)
    scores = np.zeros((part.max() + 1, 2))
    np.add.at(scores, part.ravel(), each * _known(seen - contrast * level.values)[:, None])
    parts = int(np.count_nonzero(scores.any(axis=1)))
    contradiction = bread @ scores.T @ scores @ bread * (parts / max(parts - 1, 1))
    return np.asarray(contradiction + _INTERPOLATION_PX**2 * np.eye(2))


def _climb(picture: Image, level: Level, weight: Floats, shift: Floats, size: tuple[int, int]) -> tuple[Floats, Floats]:
    """Take Gauss-Newton steps from a shift, with Tukey's weights."""
    for _ in range(_STEPS):
        seen = values_at(picture, level.places + shift, size)
        contrast, fits = _fits(seen, level, weight)
        each = (weight * fits / level.sigma**2)[:, None] * level.slopes
        normal = each.T @ level.slopes + 1e-9 * np.eye(2)
        step = -np.linalg.solve(normal, each.T @ _known(seen - contrast * level.values)) / contrast
        shift = shift + step
        if np.hypot(*step) < _SETTLED_PX:
            break
    return shift, _fits(values_at(picture, level.places + shift, size), level, weight)[1]


def _fits(seen: Floats, level: Level, weight: Floats) -> tuple[float, Floats]:
    """Return the contrast relative to the first picture, and Tukey's weights (n,) with it."""
    contrast = 1.0
    for _ in range(2):
        off2 = ((seen - contrast * level.values) / (_TUKEY * level.sigma)) ** 2
        fits = np.where(off2 < 1.0, 1.0 - off2, 0.0) ** 2  # of what is unknown, too
        both = weight * fits * level.values
        contrast = float(np.clip(both @ _known(seen) / max(both @ level.values, 1e-9), 0.5, 2.0))
    return contrast, fits


def _known(values: Floats) -> Floats:
    """Return values with 0 for those that are unknown."""
    return np.where(np.isnan(values), 0.0, values)
