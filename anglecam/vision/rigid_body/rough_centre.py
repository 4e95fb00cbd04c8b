"""A centre of rotation that is known roughly, and poses near a rotation about it.

Each pose of a thing determines the centre better, and the centre keeps a pose from what a rotation cannot do: a stick
would else slide along itself where its ends are not seen.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anglecam.data.typing import Floats
from anglecam.vision.image.transforms import rotate_each, rotation

_OFF_CENTRE_PX = 0.3
"""Standard deviation of a body's place from that for a fixed centre of rotation, px."""


@dataclass(frozen=True)
class Centre:
    """A centre of rotation that is known roughly."""

    place_px: Floats
    """(2,) px."""
    information: Floats
    """(2, 2) 1/px²."""


def with_pose(centre: Centre, pose: Floats, information: Floats, group_ratio: float, middle: Floats) -> Centre:
    """Return a centre of rotation that is known better by a pose of a thing with its middle at ``middle``."""
    turned = np.eye(2) - pose[:2, :2]
    shift = pose[:2, :2] @ middle + pose[:2, 2] - middle
    covariance = np.linalg.inv(information)[1:, 1:] * max(group_ratio, 1.0) + _OFF_CENTRE_PX**2 * np.eye(2)
    gain = turned.T @ np.linalg.inv(covariance)
    total = centre.information + gain @ turned
    off = shift + turned @ (middle - centre.place_px)
    return Centre(centre.place_px + np.linalg.solve(total, gain @ off), total)


def towards_rotation(unknowns: Floats, middle: Floats, centre: Centre) -> tuple[Floats, Floats]:
    """Return the normal matrix (3, 3) and gradient (3,) that keep a pose near a rotation about the centre."""
    turned = rotation(unknowns[0]).T - np.eye(2)
    arm = middle - centre.place_px
    spread = turned @ np.linalg.inv(centre.information) @ turned.T + _OFF_CENTRE_PX**2 * np.eye(2)
    J = np.column_stack([-rotate_each(arm, unknowns[:1] + np.pi / 2)[0], np.eye(2)])
    off = turned @ arm - unknowns[1:]
    weighted = J.T @ np.linalg.inv(spread)
    return weighted @ J, weighted @ off


def pose_of(unknowns: Floats, middle: Floats) -> Floats:
    """Return the pose (3, 3) for a rotation and a displacement of the mean."""
    pose = np.eye(3)
    pose[:2, :2] = rotation(unknowns[0]).T
    pose[:2, 2] = middle + unknowns[1:] - pose[:2, :2] @ middle
    return pose
