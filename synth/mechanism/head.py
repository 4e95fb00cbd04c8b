"""The head: a drawing inflated to a body and painted, and the position of its mouth."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import trimesh
from numpy.typing import NDArray

from synth.mechanism.curves import MM
from synth.mechanism.drawings import MAN, WOMAN
from synth.mechanism.inflate import Body, Lattice, inflate
from synth.mechanism.paint import paint, palette
from synth.mechanism.part import Part
from synth.mechanism.profile import Profile, head_profile
from synth.spec import Rig

Floats = NDArray[np.float64]

HALF_WIDTH = 66 * MM
"""Half the width of the head, m."""
NEAR = (
    Lattice(1.6 * MM, (-14 * MM, 18 * MM, 28 * MM, 90 * MM)),  # ear
    Lattice(1.6 * MM, (80 * MM, -20 * MM, 142 * MM, 90 * MM)),  # eye, nose, mouth
    Lattice(2.4 * MM, (20 * MM, -60 * MM, 125 * MM, 125 * MM)),  # skin
    Lattice(3.4 * MM),
)
"""Vertices on the camera's side, and on the far side, which is fine only where a view from the front shows it."""
FAR = (Lattice(3 * MM, band=12 * MM), Lattice(8 * MM))


def head(rig: Rig, rng: np.random.Generator) -> list[Part]:
    """Build the head in its frame, which is the rig's at neutral.

    Parameters
    ----------
    rig : Rig
        Kind of head, colours of skin and lips, and whether the neck is human.
    rng : numpy.random.Generator
        Source of the skin's texture.

    Returns
    -------
    list of Part
        One for each region; neighbouring regions share exactly the same boundary vertices.
    """
    profile, body = _shape(rig.head, rig.neck == "human")
    return dress(body, profile, "head", palette(rig.skin_rgb, rig.lips_rgb), rng)


def dress(
    body: Body, profile: Profile, moves_with: str, colours: dict[str, Floats], rng: np.random.Generator
) -> list[Part]:
    """Paint a body and split it into one part per region."""
    painted = dict(zip(colours, paint(body, colours, profile.shades, rng), strict=True))
    parts = []
    for name in np.unique(body.labels):
        used, faces = np.unique(body.faces[body.labels == name], return_inverse=True)
        mesh = trimesh.Trimesh(
            body.vertices[used], faces.reshape(-1, 3), vertex_normals=body.normals[used], process=False
        )
        parts.append(Part(str(name), moves_with, mesh, painted[str(name)][used]))
    return parts


def mouth_centre(parts: list[Part], distance: float) -> Floats:
    """Return the centre of the lips' visible area at neutral, as a point of the plane z = 0.

    Parameters
    ----------
    parts : list of Part
        Parts of the rig, including the lips.
    distance : float
        Distance of the camera from the plane z = 0, m.

    Returns
    -------
    ndarray
        (x, y), m.
    """
    lips = next(part.mesh for part in parts if part.name == "lips")
    flat = lips.vertices[:, :2] * (distance / (distance - lips.vertices[:, 2]))[:, None]
    corners = flat[lips.faces]
    ahead, behind = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = ahead[:, 0] * behind[:, 1] - ahead[:, 1] * behind[:, 0]
    seen = area > 0  # faces on the far side are wound the other way round
    return np.asarray(np.average(corners[seen].mean(axis=1), axis=0, weights=area[seen]))


def lips_outline(rig: Rig) -> Floats:
    """Return the vertices (n, 3) of the lips at neutral on the camera's side, m."""
    return _lips(rig.head, rig.neck == "human")


@lru_cache(maxsize=4)
def _lips(whose: str, nape: bool) -> Floats:
    body = _shape(whose, nape)[1]
    lips = body.vertices[np.unique(body.faces[body.labels == "lips"])]
    return np.asarray(lips[lips[:, 2] >= 0])


@lru_cache(maxsize=4)
def _shape(whose: str, nape: bool) -> tuple[Profile, Body]:
    profile = head_profile(WOMAN if whose == "female" else MAN, nape)
    return profile, inflate(profile, HALF_WIDTH, NEAR, FAR)
