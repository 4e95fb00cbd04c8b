"""One coloured piece of the rig or of the scene around it."""

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
    """One coloured piece that moves as a whole."""

    name: str
    body: str
    """What it moves with, ``ground`` where it does not: a key of what `poses` or `prop_poses` returns."""
    mesh: trimesh.Trimesh
    """In the body's own frame, m."""
    colours: Floats
    """(n, 3), one for each vertex, sRGB 0-255."""


def machined(name: str, body: str, mesh: trimesh.Trimesh, rgb: Rgb) -> Part:
    """Give a piece one colour."""
    return Part(name, body, mesh, np.tile(np.asarray(rgb, dtype=float), (len(mesh.vertices), 1)))
