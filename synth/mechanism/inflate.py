"""Inflates a flat drawing to a body: the outline stays in the plane of symmetry and the inside rises like a cushion.

The height over the plane is z = Z·sqrt(φ/φ_max) with ∇²φ = −1 inside and φ = 0 on the outline (finite elements on
the drawing's triangles). The surface is smooth and meets the plane at a right angle, so the silhouette in a view square
to the plane is the drawn outline itself.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve
from scipy.spatial import Delaunay, cKDTree

from synth.mechanism.curves import MM, inside
from synth.mechanism.profile import Profile

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

RING = 0.3 * MM
"""Distance of the first ring of vertices from the outline, m: the surface is steepest there."""


@dataclass(frozen=True)
class Lattice:
    """A triangular lattice of vertices over part of the drawing."""

    spacing: float
    """m."""
    box: tuple[float, ...] | None = None
    """Low x, low y, high x, high y, m; the whole drawing by default."""
    band: float = math.inf
    """Largest distance from the outline, m."""


@dataclass(frozen=True)
class Body:
    """A closed surface whose triangles are labelled by region, symmetric about z = 0 except for its triangulation."""

    vertices: Floats
    """(n, 3), m."""
    normals: Floats
    """(n, 3), of unit length, pointing outwards."""
    faces: Ints
    """(m, 3), counter-clockwise seen from outside."""
    labels: NDArray[np.str_]
    """(m,), a key of `Profile.regions`, or ``skin``."""


def inflate(profile: Profile, half_width: float, near: Sequence[Lattice], far: Sequence[Lattice]) -> Body:
    """Inflate a drawing.

    Parameters
    ----------
    profile : Profile
        Outline, regions and relief, m. Relief multiplies the height, so it does not move the outline.
    half_width : float
        Largest height over the plane of symmetry before the relief, m.
    near, far : sequence of Lattice
        Vertices away from the curves, the finest first, on the side of +z, which the camera sees, and on the far side.

    Returns
    -------
    Body
        Watertight.
    """
    rim = len(profile.outline)
    points, triangles, height = _half(profile, half_width, near)
    behind, turned, depth = _half(profile, half_width, far)
    # Both sides share the rim's vertices, which come first in both.
    shared = np.concatenate([np.arange(rim), len(points) + np.arange(len(behind) - rim)])
    vertices = np.vstack([np.column_stack([points, height]), np.column_stack([behind, -depth])[rim:]])
    faces = np.vstack([triangles, shared[turned][:, ::-1]])
    centres = np.vstack([points[triangles].mean(axis=1), behind[turned].mean(axis=1)])
    return Body(vertices, _normals(vertices, faces), faces, _labels(profile, centres))


def _half(profile: Profile, half_width: float, lattices: Sequence[Lattice]) -> tuple[Floats, Ints, Floats]:
    """Return one side: points of the drawing, counter-clockwise triangles, and heights."""
    points = _points(profile, lattices)
    triangles = np.asarray(Delaunay(points).simplices, dtype=np.int64)
    triangles = triangles[inside(profile.outline, points[triangles].mean(axis=1))]
    ahead, behind = (points[triangles[:, k]] - points[triangles[:, 0]] for k in (1, 2))
    turned = ahead[:, 0] * behind[:, 1] - ahead[:, 1] * behind[:, 0] < 0
    triangles[turned] = triangles[turned][:, ::-1]
    phi = _cushion(points, triangles, np.arange(len(points)) < len(profile.outline))
    height = half_width * np.sqrt(np.maximum(phi, 0.0) / phi.max())
    for stroke in profile.relief:
        height *= 1 + stroke.gain * stroke.share(points)
    return points, triangles, height


def _points(profile: Profile, lattices: Sequence[Lattice]) -> Floats:
    """Return the vertices: the outline, the regions' curves, a ring inside the outline, lattices in the free area."""
    outline = profile.outline
    drawn = outline
    for curve in profile.regions.values():
        step = np.hypot(*np.diff(curve, axis=0).T).mean()
        free = inside(outline, curve) & (cKDTree(drawn).query(curve)[0] > 0.45 * step)
        drawn = np.vstack([drawn, curve[free]])
    along = np.roll(outline, -1, axis=0) - np.roll(outline, 1, axis=0)
    across = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.hypot(*along.T)[:, None]
    ring = np.vstack([outline + RING * across, outline - RING * across])
    ring = ring[inside(outline, ring) & (cKDTree(outline).query(ring)[0] > 0.9 * RING)]
    if len(drawn) > len(outline):  # keep the ring away from where a region's curve meets the outline
        ring = ring[cKDTree(drawn[len(outline) :]).query(ring)[0] > 2.2 * RING]
    drawn = np.vstack([drawn, ring])
    for lattice in lattices:
        nodes = _nodes(lattice.spacing, *(lattice.box or (*drawn.min(axis=0), *drawn.max(axis=0))))
        nodes = nodes[inside(outline, nodes) & (cKDTree(outline).query(nodes)[0] < lattice.band)]
        drawn = np.vstack([drawn, nodes[cKDTree(drawn).query(nodes)[0] > 0.5 * lattice.spacing]])
    return drawn


def _nodes(spacing: float, low_x: float, low_y: float, high_x: float, high_y: float) -> Floats:
    x, y = np.meshgrid(np.arange(low_x, high_x, spacing), np.arange(low_y, high_y, spacing * np.sqrt(3) / 2))
    x[1::2] += spacing / 2
    return np.column_stack([x.ravel(), y.ravel()])


def _cushion(points: Floats, triangles: Ints, rim: NDArray[np.bool_]) -> Floats:
    """Solve ∇²φ = −1 with φ = 0 on the rim, by linear finite elements."""
    corners = points[triangles]
    opposite = np.roll(corners, -1, axis=1) - np.roll(corners, -2, axis=1)
    area = 0.5 * np.abs(opposite[:, 0, 0] * opposite[:, 1, 1] - opposite[:, 0, 1] * opposite[:, 1, 0])
    local = np.einsum("mik,mjk->mij", opposite, opposite) / (4 * area)[:, None, None]
    row, column = np.repeat(triangles, 3, axis=1).ravel(), np.tile(triangles, (1, 3)).ravel()
    stiffness = coo_matrix((local.ravel(), (row, column)), shape=(len(points),) * 2).tocsr()
    load = np.bincount(triangles.ravel(), np.repeat(area / 3, 3), len(points))
    phi = np.zeros(len(points))
    phi[~rim] = spsolve(stiffness[~rim][:, ~rim], load[~rim])
    return phi


def _labels(profile: Profile, centres: Floats) -> NDArray[np.str_]:
    labels = np.full(len(centres), "skin", dtype="<U16")
    for name, curve in profile.regions.items():
        labels[inside(curve, centres)] = name
    return labels


def _normals(vertices: Floats, faces: Ints) -> Floats:
    """Return the vertex normals, weighted by the triangles' areas."""
    corners = vertices[faces]
    weighted = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros_like(vertices)
    for k in range(3):
        np.add.at(normals, faces[:, k], weighted)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)
