"""All parts joined to one set of triangles, and the edges along which the picture may be discontinuous.

Across most edges of a mesh the light is continuous. The picture is discontinuous only where the surface ends, where its
normals or its colour jump (a *sharp* edge), or where one of the two triangles faces away from the camera (the
silhouette, which depends on the pose).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from synth.draw.light import albedo
from synth.mechanism import Part

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

_SAME_PLACE = 1e-9
"""Vertices of a part this close together count as one point, m."""
_SAME_LOOK = 1e-6
"""Difference of normals or of colours (0-255) that counts as invisible."""


@dataclass(frozen=True)
class Surface:
    """Every part of the scene, each body in its frame."""

    bodies: tuple[str, ...]
    """Names of the bodies, the keys of the poses."""
    vertices: Floats
    """(n, 3), m."""
    normals: Floats
    """(n, 3)."""
    albedo: Floats
    """(n, 3), 0..1, `synth.draw.light.albedo`."""
    body: Ints
    """(n,), index into `bodies`."""
    faces: Ints
    """(m, 3), counter-clockwise seen from outside."""
    part: Ints
    """(m,), number of the face's part."""
    edges: Ints
    """(e, 2), vertices."""
    sides: Ints
    """(e, 2), faces that meet there; -1 in place of a missing second face."""
    sharp: NDArray[np.bool_]
    """(e,), whether the picture is discontinuous there in every view."""


def join(parts: Sequence[Part], gamma: float) -> Surface:
    """Join parts.

    Parameters
    ----------
    parts : sequence of Part
        In their bodies' frames.
    gamma : float
        Gamma of the sensor, see `synth.draw.light.albedo`.

    Returns
    -------
    Surface
        With vertices and faces in the order of the parts.
    """
    bodies = tuple(sorted({part.body for part in parts}))
    vertices = np.vstack([part.mesh.vertices for part in parts]).astype(float)
    normals = np.vstack([part.mesh.vertex_normals for part in parts]).astype(float)
    colours = np.vstack([part.colours for part in parts]).astype(float)
    sizes = [len(part.mesh.vertices) for part in parts]
    firsts = np.cumsum([0, *sizes[:-1]])
    faces = np.vstack([part.mesh.faces + first for part, first in zip(parts, firsts, strict=True)]).astype(np.int32)
    owner = np.repeat(np.arange(len(parts)), sizes)
    part = np.repeat(np.arange(len(parts)), [len(part.mesh.faces) for part in parts]).astype(np.int32)
    edges, sides, sharp = _edges(vertices, np.hstack([normals, colours]), faces, owner)
    return Surface(
        bodies=bodies,
        vertices=vertices,
        normals=normals,
        albedo=albedo(colours, gamma),
        body=np.repeat([bodies.index(part.body) for part in parts], sizes).astype(np.int32),
        faces=faces,
        part=part,
        edges=edges,
        sides=sides,
        sharp=sharp,
    )


def _edges(
    vertices: Floats, looks: Floats, faces: Ints, owner: NDArray[np.int64]
) -> tuple[Ints, Ints, NDArray[np.bool_]]:
    """Find the faces of a part that meet at each edge, even if they do not share its vertices."""
    places = np.column_stack([owner, np.round(vertices / _SAME_PLACE)])
    place = np.unique(places, axis=0, return_inverse=True)[1].ravel()
    half = np.vstack([faces[:, [k, (k + 1) % 3]] for k in range(3)])
    face = np.tile(np.arange(len(faces)), 3)
    turned = place[half[:, 0]] > place[half[:, 1]]
    half[turned] = half[turned][:, ::-1]

    order = np.lexsort((face, place[half[:, 1]], place[half[:, 0]]))
    half, face = half[order], face[order]
    ends = place[half]
    new = np.r_[True, (np.diff(ends, axis=0) != 0).any(axis=1)]
    count = np.bincount(np.cumsum(new) - 1)
    firsts = np.flatnonzero(new)
    pairs = firsts[count == 2]
    differ = np.abs(looks[half[pairs]] - looks[half[pairs + 1]]).max(axis=(1, 2)) > _SAME_LOOK
    # Where a single face ends, or more than two meet, each face has a separate edge.
    alone = np.repeat(count != 2, count)
    edges = np.vstack([half[pairs], half[alone]])
    sides = np.vstack(
        [np.column_stack([face[pairs], face[pairs + 1]]), np.column_stack([face[alone], -np.ones(alone.sum(), int)])]
    )
    return edges.astype(np.int32), sides.astype(np.int32), np.r_[differ, np.ones(alone.sum(), dtype=bool)]
