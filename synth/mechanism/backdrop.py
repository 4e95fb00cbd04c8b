"""The wall behind the rig: plain, slightly brighter at the top, square to the line of sight, just larger than the view.

It is fixed to the camera rather than to the room, so it fills the picture in every view and at every distance.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from synth.camera import aim
from synth.mechanism.curves import MM
from synth.mechanism.part import Part
from synth.mechanism.sight import before
from synth.mechanism.solids import woven
from synth.spec import Spec

Floats = NDArray[np.float64]

BEHIND = 320 * MM
"""Distance from the shaft's point in the plane of motion to the wall, m: farther than any part of the rig reaches."""
_MARGIN = 0.25
"""Margin on each side as a share of the picture, for lens distortion and camera vibration."""
_CELL = 64
"""Mesh size, px: small enough to follow the lens distortion."""
_BELOW, _ABOVE = np.array([122.0, 130.0, 138.0]), np.array([194.0, 202.0, 208.0])


def backdrop(spec: Spec, lever: float) -> Part:
    """Build the wall, of body ``ground``.

    Parameters
    ----------
    spec : Spec
        Its camera is used.
    lever : float
        Distance from pivot to mouth, m, which sets the camera's focal length.

    Returns
    -------
    Part
        Mesh in the rig's frame.
    """
    camera = aim(spec, lever)
    width, height = camera.size
    x, y = (np.linspace(-_MARGIN, 1 + _MARGIN, 2 + int(1.5 * side / _CELL)) for side in (width, height))
    grid = np.stack(np.meshgrid(x * width, (1 - y) * height, indexing="ij"), axis=-1)
    points = before(camera, grid, -BEHIND)
    rise = (np.clip(y, 0, 1) ** 2 * (3 - 2 * np.clip(y, 0, 1)))[None, :, None]  # smooth at both ends
    colours = np.broadcast_to(_BELOW + rise * (_ABOVE - _BELOW), points.shape)
    wall = woven(points, np.broadcast_to(camera.rotation[2], points.shape))
    return Part("wall", "ground", wall, colours.reshape(-1, 3).copy())
