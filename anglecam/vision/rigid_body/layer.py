"""A thing in front of a still background as a layer, and its pose in a frame.

Before a servo's horn the background changes from blue to wood, and with it every edge of the horn. A frame is
therefore compared with what is expected of it: the layer in its pose, and the background where the layer does not
cover it (Wang and Adelson 1994). The pose is found by least squares, first in blurred pictures.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from anglecam.data.typing import Flags, Floats, Image
from anglecam.vision.image.transforms import turn_of
from anglecam.vision.rigid_body.rough_centre import Centre, pose_of, towards_rotation

_BLURS_PX = (6.0, 3.0, 1.5, 1.5)
"""Standard deviations of the filters of successive steps, px; the first is that of the error of a guess."""
_STEPS = 3
"""Steps in each blurred picture."""
_EDGE_PX = 0.7
"""Standard deviation of the blur of a layer's edge, px."""
_STEP_PX = 0.5
"""Displacement at which derivatives are taken, px."""
_FAR = 2.5
"""Standard deviations at which a pixel has half the weight."""
_FLOOR = 2.0
"""Least standard deviation of a pixel, grey levels: a layer is not known better."""
_PREDICTED_TURN, _PREDICTED_PX = 0.1, 10.0
"""Standard uncertainty of a guess, rad and px."""
_CLEAR = 15.0
"""Least difference of colours, grey levels, by which a layer is told from the background."""
_VISIBLE = 0.1
"""Least share of the layer that must differ from the background: a white horn is not seen before white paper."""
_SECTORS = 8
"""Sectors around the middle, whose pixels may have a common error."""
_TOUCHES = 0.1
"""Share of a blurred pixel from which on its value depends on the pose."""
_COVERS = 0.5
"""Share of a pixel from which on the layer is what is seen there."""


@dataclass(frozen=True)
class Layer:
    """What a thing looks like in the reference, in a box."""

    corner_px: Floats
    """(2,) of the box in the picture, px."""
    share: Image
    """(h, w, 1) of each pixel that the thing covers, 0 to 1."""
    light: Image
    """(h, w, planes) that it contributes: its colour times its share."""

    @property
    def pixels(self) -> int:
        """Pixels that the thing covers."""
        return int((self.share > _COVERS).sum())

    @property
    def middle(self) -> Floats:
        """(2,) of the thing, px."""
        y, x = np.nonzero(self.share[..., 0] > _COVERS)
        return self.corner_px + np.array([x.mean(), y.mean()])

    @property
    def size_px(self) -> float:
        """Root mean square distance of its pixels from the middle, px."""
        y, x = np.nonzero(self.share[..., 0] > _COVERS)
        return float(np.sqrt(x.var() + y.var()))


@dataclass(frozen=True)
class LayerMatch:
    """A layer in one frame."""

    pose: Floats
    """(3, 3) from the reference into the frame, near a rotation about the centre."""
    free_pose: Floats
    """(3, 3) the same by the layer alone."""
    information: Floats
    """(3, 3) of the free pose's rotation, rad, and displacement of the middle, px."""
    group_ratio: float
    """Scatter of the rotation between sectors over that of independent pixels."""
    seen: float
    """Share of the pixels where layer and background differ in which the frame is more like the layer."""


def cut_layer(picture: Image, background: Image, covered: Flags) -> Layer:
    """Cut a thing out of a picture.

    Parameters
    ----------
    picture, background : ndarray
        (h, w, planes).
    covered : ndarray
        (h, w) pixels of the thing, at least one.
    """
    y, x = np.nonzero(covered)
    margin = int(np.ceil(3.0 * _EDGE_PX))
    top, left = max(int(y.min()) - margin, 0), max(int(x.min()) - margin, 0)
    box = np.s_[top : y.max() + margin + 1, left : x.max() + margin + 1]
    share = cv2.GaussianBlur(covered[box].astype(np.float32), (0, 0), _EDGE_PX)[..., None]
    light = picture[box].astype(np.float32) - (1.0 - share) * background[box]
    return Layer(np.array([left, top], dtype=float), share, light)


def match_layer(layer: Layer, image: Image, background: Image, guess: Floats, centre: Centre) -> LayerMatch | None:
    """Find the pose of a layer in a frame by least squares.

    Parameters
    ----------
    layer : Layer
        In the reference.
    image, background : ndarray
        (h, w, planes).
    guess : ndarray
        (3, 3) predicted pose, some pixels off.
    centre : Centre
        What is known of the centre of rotation.

    Returns
    -------
    LayerMatch or None
        ``None`` where the layer is outside the picture, or its pose is not determined.
    """
    middle = layer.middle
    predicted = np.array([turn_of(guess), *(guess[:2, :2] @ middle + guess[:2, 2] - middle)])
    prior = np.diag([_PREDICTED_TURN**-2, _PREDICTED_PX**-2, _PREDICTED_PX**-2])
    box = _box_around(layer, guess, background.shape[1::-1])
    if box is None:
        return None
    corner = np.array([box[1].start, box[0].start], dtype=float)
    seen, behind = image[box].astype(np.float32), background[box].astype(np.float32)
    unknowns = predicted
    for blur in _BLURS_PX:
        target = _blurred(seen, blur)
        J, inside = _derivatives(layer, behind, corner, unknowns, blur)
        if not inside.any():
            return None
        for _ in range(_STEPS):
            expected = _blurred(_expected(layer, behind, corner, unknowns)[0], blur)
            rest = (target - expected).astype(float).ravel()
            scale = max(_FLOOR, 1.4826 * float(np.median(np.abs(rest[inside]))))
            weight = inside / (1.0 + (rest / (_FAR * scale)) ** 2)
            information = np.einsum("kp,p,lp->kl", J, weight, J) / scale**2
            gradient = J @ (weight * rest) / scale**2
            bound, pull = towards_rotation(unknowns, middle, centre)
            step = np.linalg.solve(information + prior + bound, gradient + prior @ (predicted - unknowns) + pull)
            unknowns = unknowns + step
    if np.linalg.matrix_rank(information) < len(information):
        return None
    free = unknowns + np.linalg.solve(information, gradient - information @ step)
    return LayerMatch(
        pose=pose_of(unknowns, middle),
        free_pose=pose_of(free, middle),
        information=information,
        group_ratio=_sector_ratio(J[0] * weight * rest, seen.shape, corner - middle - unknowns[1:]),
        seen=_seen(layer, seen, behind, corner, unknowns),
    )


def _derivatives(layer: Layer, behind: Image, corner: Floats, unknowns: Floats, blur: float) -> tuple[Floats, Flags]:
    """Return the derivatives (3, p) of a blurred frame's p values by the pose, and which values show the layer."""
    by_pose = []
    for change in np.diag([_STEP_PX / layer.size_px, _STEP_PX, _STEP_PX]):
        more, less = (_expected(layer, behind, corner, unknowns + side * change)[0] for side in (0.5, -0.5))
        by_pose.append(_blurred((more - less) / change.sum(), blur).ravel())
    share = _expected(layer, behind, corner, unknowns)[1]
    inside = cv2.GaussianBlur(share, (0, 0), blur) > _TOUCHES
    return np.array(by_pose, dtype=float), np.repeat(inside.ravel(), behind.shape[2])


def _expected(layer: Layer, behind: Image, corner: Floats, unknowns: Floats) -> tuple[Image, Image]:
    """Return what is expected in a box of a frame, and the layer's share of its pixels."""
    pose = pose_of(unknowns, layer.middle)
    matrix = pose[:2].copy()
    matrix[:, 2] += pose[:2, :2] @ layer.corner_px - corner
    size = behind.shape[1::-1]
    share = cv2.warpAffine(layer.share, matrix, size, flags=cv2.INTER_LINEAR)
    light = cv2.warpAffine(layer.light, matrix, size, flags=cv2.INTER_LINEAR).reshape(behind.shape)
    return light + (1.0 - share[..., None]) * behind, share


def _seen(layer: Layer, seen: Image, behind: Image, corner: Floats, unknowns: Floats) -> float:
    """Return the share of the pixels at which layer and background differ in which the layer is seen."""
    expected, share = _expected(layer, behind, corner, unknowns)
    differ = (share > _COVERS) & (((expected - behind) ** 2).sum(axis=2) > _CLEAR**2)
    like = ((seen - expected) ** 2).sum(axis=2) < ((seen - behind) ** 2).sum(axis=2)
    enough = differ.sum() > _VISIBLE * layer.pixels
    return float((like & differ).sum() / differ.sum()) if enough else 0.0


def _box_around(layer: Layer, guess: Floats, size: tuple[int, ...]) -> tuple[slice, slice] | None:
    """Return the part of the picture (rows, columns) in which a layer may be; ``None`` where it is outside."""
    h, w = layer.share.shape[:2]
    corners = layer.corner_px + np.array([[0, 0], [w, 0], [0, h], [w, h]], dtype=float)
    placed = corners @ guess[:2, :2].T + guess[:2, 2]
    margin = 2.0 * _PREDICTED_PX
    low = np.clip(np.floor(placed.min(axis=0) - margin), 0, size).astype(int)
    high = np.clip(np.ceil(placed.max(axis=0) + margin), 0, size).astype(int)
    return None if (high - low < 2).any() else (slice(low[1], high[1]), slice(low[0], high[0]))


def _blurred(picture: Image, blur: float) -> Image:
    return cv2.GaussianBlur(picture, (0, 0), blur).reshape(picture.shape)


def _sector_ratio(torque: Floats, shape: tuple[int, ...], offset: Floats) -> float:
    """Return the scatter of the rotation between sectors of the picture over that of independent pixels."""
    y, x = np.mgrid[: shape[0], : shape[1]].astype(float)
    angle = np.arctan2(y + offset[1], x + offset[0])
    sector = np.repeat((np.floor((angle / np.pi + 1.0) / 2.0 * _SECTORS).astype(int) % _SECTORS).ravel(), shape[2])
    expected = float((torque**2).sum())
    return float((np.bincount(sector, torque, _SECTORS) ** 2).sum()) / expected if expected > 0.0 else 1.0
