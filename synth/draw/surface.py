"""All parts as one heap of triangles, and the edges along which the picture may break.

Across most edges of a mesh nothing happens: the light goes on continuously and one pixel on it is as good as another.
The picture breaks only where the surface ends, where its normals or its colour jump (a *sharp* edge), or where one of
the two triangles looks away from the camera (the silhouette, which depends on the pose).
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
"""Vertices of a part that lie this close are one point, m."""
_SAME_LOOK = 1e-6
"""Difference of normals or of colours (0-255) that does not show."""


@dataclass(frozen=True)
class Surface:
    """Every part of the scene, each body in its own frame."""

    bodies: tuple[str, ...]
    """Names by which poses are given."""
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
    """(m,), number of the part that a face belongs to."""
    edges: Ints
    """(e, 2), vertices."""
    sides: Ints
    """(e, 2), faces that meet there; -1 where there is no second one."""
    sharp: NDArray[np.bool_]
    """(e,), whether the picture breaks there however the edge is seen."""


def join(parts: Sequence[Part], gamma: float) -> Surface:
    """Heap up parts.

    Parameters
    ----------
    parts : sequence of Part
        In their bodies' frames.
    gamma : float
        Of the sensor, see `synth.draw.light.albedo`.

    Returns
    -------
    Surface
        Its vertices and faces in the order of the parts.
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
    """Find which faces of a part meet at which edge, though they may have vertices of their own there."""
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
    # Where one face ends, or more than two meet, each is an end of its own.
    alone = np.repeat(count != 2, count)
    edges = np.vstack([half[pairs], half[alone]])
    sides = np.vstack(
        [np.column_stack([face[pairs], face[pairs + 1]]), np.column_stack([face[alone], -np.ones(alone.sum(), int)])]
    )
    return edges.astype(np.int32), sides.astype(np.int32), np.r_[differ, np.ones(alone.sum(), dtype=bool)]
