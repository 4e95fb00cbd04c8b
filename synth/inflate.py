"""A flat drawing blown up to a body: the outline stays in the plane of symmetry and the inside rises like a cushion.

The height over the plane is z = Z·sqrt(φ/φ_max) with ∇²φ = −1 inside and φ = 0 on the outline (finite elements on
the drawing's own triangles). It is smooth everywhere and meets the plane at a right angle, so the silhouette seen
square to the plane is the drawn outline itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve
from scipy.spatial import Delaunay, cKDTree

from synth.profile import Profile, inside

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Body:
    """A closed surface, symmetric about z = 0, whose triangles know their region."""

    vertices: Floats
    """(n, 3), m."""
    normals: Floats
    """(n, 3), unit length, outwards."""
    faces: Ints
    """(m, 3), counter-clockwise seen from outside."""
    labels: NDArray[np.str_]
    """(m,), a name of `Profile.regions`, or ``skin``."""


def inflate(
    profile: Profile, half_width: float, spacing: float, bumps: list[tuple[float, float, float, float, float]]
) -> Body:
    """Blow up a drawing.

    Parameters
    ----------
    profile : Profile
        Outline and regions, m.
    half_width : float
        Largest height over the plane of symmetry, m.
    spacing : float
        Distance between neighbouring vertices away from the curves, m.
    bumps : list of tuple
        (x, y, rx, ry, gain): the height is multiplied by 1 + gain·exp(−((x'−x)/rx)² − ((y'−y)/ry)²); a gain below
        zero dents. Being factors, they leave the outline where it is.

    Returns
    -------
    Body
        Watertight.
    """
    points = _points(profile, spacing)
    triangles = np.asarray(Delaunay(points).simplices, dtype=np.int64)
    triangles = triangles[inside(profile.outline, points[triangles].mean(axis=1))]
    ahead, behind = (points[triangles[:, k]] - points[triangles[:, 0]] for k in (1, 2))
    turned = ahead[:, 0] * behind[:, 1] - ahead[:, 1] * behind[:, 0] < 0
    triangles[turned] = triangles[turned][:, ::-1]

    rim = np.arange(len(points)) < len(profile.outline)
    phi = _cushion(points, triangles, rim)
    height = half_width * np.sqrt(np.maximum(phi, 0.0) / phi.max())
    for x, y, rx, ry, gain in bumps:
        height *= 1 + gain * np.exp(-(((points[:, 0] - x) / rx) ** 2) - ((points[:, 1] - y) / ry) ** 2)

    # The far side mirrors the near one and shares the rim.
    mirrored = np.arange(len(points))
    mirrored[~rim] = len(points) + np.arange((~rim).sum())
    near = np.column_stack([points, height])
    vertices = np.vstack([near, near[~rim] * [1, 1, -1]])
    faces = np.vstack([triangles, mirrored[triangles][:, ::-1]])
    labels = np.tile(_labels(profile, points[triangles].mean(axis=1)), 2)
    return Body(vertices, _normals(vertices, faces), faces, labels)


def _points(profile: Profile, spacing: float) -> Floats:
    """Vertices: the outline first, then the regions' curves, then a triangular lattice where there is room."""
    curves = [profile.outline]
    for curve in profile.regions.values():
        taken = cKDTree(np.vstack(curves))
        step = np.hypot(*np.diff(curve, axis=0).T).mean()
        free = inside(profile.outline, curve) & (taken.query(curve)[0] > 0.45 * step)
        curves.append(curve[free])
    drawn = np.vstack(curves)
    low, high = profile.outline.min(axis=0), profile.outline.max(axis=0)
    x, y = np.meshgrid(
        np.arange(low[0], high[0], spacing), np.arange(low[1], high[1], spacing * np.sqrt(3) / 2), indexing="xy"
    )
    x[1::2] += spacing / 2
    lattice = np.column_stack([x.ravel(), y.ravel()])
    lattice = lattice[inside(profile.outline, lattice)]
    return np.vstack([drawn, lattice[cKDTree(drawn).query(lattice)[0] > 0.5 * spacing]])


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
    """Vertex normals, weighted by the triangles' areas."""
    corners = vertices[faces]
    weighted = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros_like(vertices)
    for k in range(3):
        np.add.at(normals, faces[:, k], weighted)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)
