"""A coloured part of the rig or of the scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from numpy.typing import NDArray

from synth.spec import Rgb

Floats = NDArray[np.float64]


ALUMINIUM, STEEL, BRASS, PLASTIC, PAINT, LABEL = (
    (176, 181, 186), (112, 118, 127), (182, 156, 96), (46, 48, 54), (80, 88, 100), (64, 92, 128),
)  # fmt: skip
PALE, DARK = (238, 238, 234), (22, 22, 24)


@dataclass(frozen=True)
class Part:
    """A coloured part that moves as a rigid body."""

    name: str
    body: str
    """The body it moves with, a key of `poses` or `prop_poses`; ``ground`` if it is fixed."""
    mesh: trimesh.Trimesh
    """In the body's frame, m."""
    colours: Floats
    """(n, 3), one for each vertex, sRGB 0-255."""


def machined(name: str, body: str, mesh: trimesh.Trimesh, rgb: Rgb) -> Part:
    """Return a part of a single colour."""
    return Part(name, body, mesh, np.tile(np.asarray(rgb, dtype=float), (len(mesh.vertices), 1)))
