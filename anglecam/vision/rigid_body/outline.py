"""The outline of what moves before a still background, and its pose in a frame.

A ball, a stick or a wheel of one colour has few features, and its colour may be that of stains on the wall behind it.
Its outline differs from the background all the same, and a soft shadow has none. An outline is searched along its
normals for the place where the picture's difference from the background changes as it did in the reference
(Harris and Stennett 1990). The distances found there determine the pose by least squares.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Flags, Floats, Image
from anglecam.vision.image.clusters import group_neighbours
from anglecam.vision.image.transforms import rotation, turn_of
from anglecam.vision.rigid_body.rough_centre import Centre, pose_of, towards_rotation

OUTLINE_GROUPS = 8
"""Groups of neighbouring points."""
MIN_OUTLINE_POINTS = 30
"""Fewest points, at most one for each pixel of its length, that count as an outline."""
_BLUR_PX = 1.0
"""Standard deviation of the filter in front of the derivatives, px."""
_UNIT = 1.0 / 8.0
"""Of Sobel's operator, so that an edge has the slope of its brightness, grey levels/px."""
_STRUCTURE_PX = 1.0
"""Standard deviation of the filter of the products of derivatives, whose main axis is the normal, px."""
_STEP_PX = 0.5
"""Distance between the places that are compared along a normal, px."""
_REACHES_PX = (12.0, 9.0, 6.7, 5.0, 3.8, 2.8, 2.1, 2.0, 2.0, 2.0, 2.0, 2.0)
"""Distances along the normals that are searched in successive steps, px; the first is that of a wrong prediction."""
_LIKE = 2.0
"""Largest ratio of an edge's slope to that of the reference, either way. Beyond, it is another edge."""
_FLOOR_PX = 0.15
"""Least standard deviation of a place on the outline, px: light and shade displace it."""
_FAR = 2.0
"""Standard deviations at which a point has half the weight."""
_FOLLOWS_PX = 1.0
"""Distance within which a point follows the pose, px."""
_PREDICTED_TURN, _PREDICTED_PX = 0.05, 6.0
"""Standard uncertainty of a predicted pose, rad and px."""
_NORMAL_ERROR = 0.1
"""Standard deviation of the normals' directions, rad; a few hundredths where light and noise disturb an edge."""
_LEAST_INFORMATION = 1e-6
"""Of an unknown that the outline does not show."""


@dataclass(frozen=True)
class Slopes:
    """Slopes of a picture's difference from the still background, grey levels/px."""

    along_x: Image
    """(h, w, planes)."""
    along_y: Image

    @property
    def steepness(self) -> Image:
        """(h, w) of all planes together."""
        return np.asarray(np.sqrt((self.along_x**2 + self.along_y**2).sum(axis=2)))


@dataclass(frozen=True)
class Outline:
    """Points on the edges of what moves, in a reference frame."""

    points: Floats
    """(k, 2) px."""
    normals: Floats
    """(k, 2) unit vectors."""
    colours: Floats
    """(k, planes) unit vectors: the change of colour along the normal."""
    steepness: Floats
    """(k,) grey levels/px."""
    groups: NDArray[np.intp]
    """(k,) group of neighbours to which each point belongs."""

    @property
    def middle(self) -> Floats:
        """(2,) mean of the points, px."""
        return np.asarray(self.points.mean(axis=0))

    def part(self, members: Flags) -> Outline:
        """Return some of the points."""
        points = self.points[members]
        groups = group_neighbours(points, OUTLINE_GROUPS)
        return Outline(points, self.normals[members], self.colours[members], self.steepness[members], groups)


@dataclass(frozen=True)
class OutlineMatch:
    """The outline in one frame."""

    pose: Floats
    """(3, 3) from the reference into the frame, near a rotation about the centre."""
    free_pose: Floats
    """(3, 3) the same by the outline alone."""
    follows: Flags
    """(k,) the points that are found where the pose has them."""
    information: Floats
    """(3, 3) of the free pose's rotation, rad, and displacement of the points' mean, px."""
    group_ratio: float
    """Scatter of the rotation between groups of neighbours over that of independent points."""
    angularity: float
    """Information on the rotation, as a share of that of points which are located in all directions: 0 for a disc."""


def slopes(image: Image, background: Image) -> Slopes:
    """Return the slopes of a picture's difference from the still background, both (h, w, planes)."""
    off = cv2.GaussianBlur(image.astype(np.float32) - background, (0, 0), _BLUR_PX).reshape(image.shape)
    along = (cv2.Sobel(off, cv2.CV_32F, *axis, scale=_UNIT).reshape(image.shape) for axis in ((1, 0), (0, 1)))
    return Slopes(*along)


def find_outline(seen: Slopes, level: float) -> Outline:
    """Find the edges that are steeper than a level, to a fraction of a pixel.

    Parameters
    ----------
    seen : Slopes
        Of the reference frame.
    level : float
        Grey levels/px.

    Returns
    -------
    Outline
        Perhaps without points.
    """
    products = (
        (seen.along_x**2).sum(axis=2),
        (seen.along_x * seen.along_y).sum(axis=2),
        (seen.along_y**2).sum(axis=2),
    )
    xx, xy, yy = (cv2.GaussianBlur(product, (0, 0), _STRUCTURE_PX) for product in products)
    direction = 0.5 * np.arctan2(2.0 * xy, xx - yy)
    steep = seen.steepness
    y, x = np.nonzero(steep > level)
    normals = np.column_stack([np.cos(direction[y, x]), np.sin(direction[y, x])])
    places = np.column_stack([x, y]).astype(float)
    before, after = (_at(steep[..., None], places + side * normals)[..., 0] for side in (-1.0, 1.0))
    here = steep[y, x]
    with np.errstate(divide="ignore", invalid="ignore"):
        beyond = 0.5 * (before - after) / (before - 2.0 * here + after)
    ridge = (here >= before) & (here > after) & (np.abs(beyond) <= 0.5)
    x, y, normals, places = x[ridge], y[ridge], normals[ridge], places[ridge]
    change = seen.along_x[y, x] * normals[:, :1] + seen.along_y[y, x] * normals[:, 1:]
    steepness = np.linalg.norm(change, axis=1)
    points = places + beyond[ridge, None] * normals
    colours = change / np.maximum(steepness, 1e-9)[:, None]
    return Outline(points, normals, colours, steepness, group_neighbours(points, OUTLINE_GROUPS))


def match_outline(outline: Outline, seen: Slopes, guess: Floats, centre: Centre) -> OutlineMatch | None:
    """Find the pose of an outline in a frame by least squares.

    Nothing but the centre of rotation keeps a stick from sliding along itself where its ends are not seen.

    Parameters
    ----------
    outline : Outline
        In the reference.
    seen : Slopes
        Of the frame.
    guess : ndarray
        (3, 3) predicted pose, at most some pixels off.
    centre : Centre
        What is known of the centre of rotation.

    Returns
    -------
    OutlineMatch or None
        ``None`` where hardly any of the outline is seen, or its pose is not determined.
    """
    middle = outline.middle
    predicted = np.array([turn_of(guess), *(guess[:2, :2] @ middle + guess[:2, 2] - middle)])
    prior = np.diag([_PREDICTED_TURN**-2, _PREDICTED_PX**-2, _PREDICTED_PX**-2])
    unknowns = predicted
    for reach in _REACHES_PX:
        M = rotation(unknowns[0])
        arm, normals = (outline.points - middle) @ M, outline.normals @ M
        off, found = _distances(outline, seen, middle + unknowns[1:] + arm, normals, reach)
        if found.sum() < MIN_OUTLINE_POINTS:
            return None
        scale = max(_FLOOR_PX, 1.4826 * float(np.median(np.abs(off[found]))))
        weight = found / (1.0 + (off / (_FAR * scale)) ** 2)
        J = _derivatives(arm, normals)
        information = (J * weight[:, None]).T @ J / scale**2
        gradient = J.T @ (weight * off) / scale**2
        bound, pull = towards_rotation(unknowns, middle, centre)
        step = np.linalg.solve(information + prior + bound, gradient + prior @ (predicted - unknowns) + pull)
        unknowns = unknowns + step
    free = unknowns + np.linalg.pinv(information) @ (gradient - information @ step)
    along = _derivatives(arm, normals[:, ::-1] * (-1.0, 1.0))
    information, rotation_alone = _less_of_normals(information, (along * weight[:, None]).T @ along / scale**2)
    if np.linalg.matrix_rank(information) < len(information):
        return None
    return OutlineMatch(
        pose=pose_of(unknowns, middle),
        free_pose=pose_of(free, middle),
        follows=found & (np.abs(off) < _FOLLOWS_PX),
        information=information,
        group_ratio=_group_ratio(outline.groups, J[:, 0] * weight * off),
        angularity=float(rotation_alone * scale**2 / (weight @ (arm**2).sum(axis=1))),
    )


def _derivatives(arm: Floats, directions: Floats) -> Floats:
    """Return (k, 3) how far a point moves in its direction with the rotation, rad, and the displacement, px."""
    return np.column_stack([directions[:, 0] * arm[:, 1] - directions[:, 1] * arm[:, 0], directions])


def _less_of_normals(information: Floats, along: Floats) -> tuple[Floats, float]:
    """Return an information matrix (3, 3) without what the normals' errors seem to add, and that of the rotation alone.

    Because of them a straight edge seems to show a motion along itself, and a disc a rotation. ``along`` is what the
    points would add if each were located along its edge.
    """
    shift = np.linalg.solve(information[1:, 1:], information[1:, 0])  # of the mean, where the rotation is about it
    about = np.array([1.0, *-shift])
    turned = about @ (information - _NORMAL_ERROR**2 * along) @ about
    rotation_alone = max(float(turned), _LEAST_INFORMATION)
    values, axes = np.linalg.eigh((information - _NORMAL_ERROR**2 * along)[1:, 1:])
    places = (axes * np.maximum(values, _LEAST_INFORMATION)) @ axes.T
    cross = places @ shift
    whole = np.block([[np.array([[rotation_alone + shift @ cross]]), cross[None]], [cross[:, None], places]])
    return whole, rotation_alone


def _distances(outline: Outline, seen: Slopes, places: Floats, normals: Floats, reach: float) -> tuple[Floats, Flags]:
    """Return how far along its normal each point's edge is found, px, and for which points one is found."""
    along = np.arange(-reach - _STEP_PX, reach + 1.5 * _STEP_PX, _STEP_PX)
    at = places[:, None] + along[:, None] * normals[:, None]
    across = normals[:, None, :1] * _at(seen.along_x, at) + normals[:, None, 1:] * _at(seen.along_y, at)
    likeness = (across * outline.colours[:, None]).sum(axis=2)
    best = 1 + likeness[:, 1:-1].argmax(axis=1)
    before, here, after = (np.take_along_axis(likeness, best[:, None] + k, axis=1)[:, 0] for k in (-1, 0, 1))
    peak = (here >= before) & (here >= after)
    curvature = np.where(peak, np.maximum(2.0 * here - before - after, 1e-9), 1.0)
    found = peak & (here > outline.steepness / _LIKE) & (here < outline.steepness * _LIKE)
    return along[best] + _STEP_PX * np.clip(0.5 * (after - before) / curvature, -1.0, 1.0), found


def _at(picture: Image, places: Floats) -> Floats:
    """Interpolate a picture (h, w, planes) at places (…, 2); zero outside."""
    if not places.size:
        return np.zeros((*places.shape[:-1], picture.shape[2]))
    flat = places.reshape(-1, 2).astype(np.float32)
    rows = 1 << 14  # OpenCV remaps to pictures of fewer than 2¹⁵ rows
    parts = [
        cv2.remap(picture, part[:, :1], part[:, 1:], cv2.INTER_LINEAR).reshape(len(part), -1)
        for part in np.split(flat, range(rows, len(flat), rows))
    ]
    return np.asarray(np.concatenate(parts), dtype=float).reshape(*places.shape[:-1], picture.shape[2])


def _group_ratio(groups: NDArray[np.intp], torque: Floats) -> float:
    """Return the scatter of the rotation between groups of neighbours over that of independent points."""
    expected = float((torque**2).sum())
    return float((np.bincount(groups, torque) ** 2).sum()) / expected if expected > 0.0 else 1.0
