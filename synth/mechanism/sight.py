"""Positions fixed to the camera rather than to the room: an object placed at a pixel appears there in every view."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from synth.camera import Pinhole

Floats = NDArray[np.float64]

_STEPS = 40
"""Iterations to invert the lens distortion; each reduces the error by a factor of about 2·k1·r²."""


def before(camera: Pinhole, pixels: Floats, height: float) -> Floats:
    """Return the points (…, 3) that a lens without distortion shows at pixels (…, 2) before mirroring.

    They lie in the plane square to the line of sight that is nearer to the camera than the shaft's point in the plane
    of motion by `height`, m.
    """
    off = (pixels - np.asarray(camera.principal_px)) * [1.0, -1.0]
    plane = np.full((*off.shape[:-1], 1), height)
    across = off * metres(camera, height) - camera.aside_m
    return np.asarray(np.concatenate([across, plane], axis=-1) @ camera.rotation)


def facing(camera: Pinhole, pixels: Floats, height: float) -> Floats:
    """Return the pose (4, 4) of a body with its origin as in `before` and axes to the right, up and at the camera."""
    pose = np.eye(4)
    pose[:3, :3] = camera.rotation.T
    pose[:3, 3] = before(camera, pixels, height)
    return pose


def metres(camera: Pinhole, height: float) -> float:
    """Return the length that appears as one pixel at a height above the shaft's point, m."""
    return (camera.distance_m - height) / camera.focal_px


def ideal(camera: Pinhole, pixel: tuple[float, float]) -> Floats:
    """Return the undistorted place before mirroring of what the picture shows at a pixel, px (2,)."""
    x = camera.size[0] - 1 - pixel[0] if camera.mirrored else pixel[0]
    seen = np.array([x, pixel[1]]) - camera.lens_px
    off = seen.copy()
    for _ in range(_STEPS):
        off = seen / (1 + camera.k1 * (off @ off) / camera.focal_px**2)
    return np.asarray(off + camera.lens_px)
