"""The wall behind the rig: plain, a little brighter above, square to the line of sight and just larger than it need be.

It hangs before the camera rather than in the room, so it fills the picture from every side and distance.
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
"""From the shaft's point in the plane of motion back to the wall: further than anything of the rig reaches."""
_MARGIN = 0.25
"""By which it is larger than the picture on each side: room for the lens and for a camera that trembles."""
_CELL = 64
"""Side of its meshes, px: short enough for a lens to bend them."""
_BELOW, _ABOVE = np.array([122.0, 130.0, 138.0]), np.array([194.0, 202.0, 208.0])


def backdrop(spec: Spec, lever: float) -> Part:
    """Build the wall, of body ``ground``.

    Parameters
    ----------
    spec : Spec
        Whose camera it faces.
    lever : float
        From pivot to mouth, m, by which the camera is aimed.

    Returns
    -------
    Part
        In the rig's frame.
    """
    camera = aim(spec, lever)
    width, height = camera.size
    x, y = (np.linspace(-_MARGIN, 1 + _MARGIN, 2 + int(1.5 * side / _CELL)) for side in (width, height))
    grid = np.stack(np.meshgrid(x * width, (1 - y) * height, indexing="ij"), axis=-1)
    points = before(camera, grid, -BEHIND)
    rise = (np.clip(y, 0, 1) ** 2 * (3 - 2 * np.clip(y, 0, 1)))[None, :, None]  # soft at both ends
    colours = np.broadcast_to(_BELOW + rise * (_ABOVE - _BELOW), points.shape)
    wall = woven(points, np.broadcast_to(camera.rotation[2], points.shape))
    return Part("wall", "ground", wall, colours.reshape(-1, 3).copy())
