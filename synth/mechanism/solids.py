"""Machined parts: blocks, turned parts, links and wires, with finely divided sharp edges.

Lens distortion bends straight lines, but the renderers move only vertices, so long edges need many vertices. The faces
of a part do not share vertices, so that each face has separate normals.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import trimesh
from numpy.typing import NDArray

Floats = NDArray[np.float64]

LONGEST = 9e-3
"""Longest step along an edge, m."""


def block(low: tuple[float, float, float], high: tuple[float, float, float]) -> trimesh.Trimesh:
    """Build a box between two opposite corners, m."""
    start, size = np.asarray(low), np.asarray(high) - low
    sheets = []
    for axis in range(3):
        one, other = np.eye(3)[(axis + 1) % 3] * size, np.eye(3)[(axis + 2) % 3] * size
        sheets.append(sheet(start + np.eye(3)[axis] * size, one, other))
        sheets.append(sheet(start, other, one))
    return joined(sheets)


def sheet(corner: Floats, one: Floats, other: Floats) -> trimesh.Trimesh:
    """Build a parallelogram from a corner and two sides, facing along their cross product, m."""
    across = np.linspace(0, 1, 1 + int(np.ceil(np.linalg.norm(one) / LONGEST)))
    along = np.linspace(0, 1, 1 + int(np.ceil(np.linalg.norm(other) / LONGEST)))
    grid = corner + across[:, None, None] * one + along[None, :, None] * other
    normal = np.cross(one, other)
    return woven(grid, np.broadcast_to(normal / np.linalg.norm(normal), grid.shape))


def turned(profile: Sequence[tuple[float, float]], sections: int = 72) -> trimesh.Trimesh:
    """Build a solid of revolution about the z axis.

    Parameters
    ----------
    profile : sequence of tuple of float
        (radius, z) from the lower end to the upper, m; each straight segment is a separate face.
    sections : int
        Number of sections around the axis.

    Returns
    -------
    trimesh.Trimesh
        Closed if the profile begins and ends on the axis.
    """
    angles = np.linspace(0, 2 * np.pi, sections + 1)
    angles[-1] = 0.0  # so that both sides of the seam are exactly the same points
    around = np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=1)
    bands = []
    for (r0, z0), (r1, z1) in itertools.pairwise(profile):
        length = np.hypot(r1 - r0, z1 - z0)
        share = np.linspace(0, 1, 1 + int(np.ceil(length / LONGEST)))
        grid = around[:, None] * (r0 + share * (r1 - r0))[None, :, None]
        grid[..., 2] += z0 + share * (z1 - z0)
        normals = around * (z1 - z0) / length + np.array([0.0, 0.0, (r0 - r1) / length])
        bands.append(woven(grid, np.broadcast_to(normals[:, None], grid.shape)))
    return joined(bands)


def rod(centre: tuple[float, float], radius: float, low: float, high: float, sections: int = 40) -> trimesh.Trimesh:
    """Build a cylinder along z with a chamfer at the upper end, m."""
    edge = min(0.4e-3, radius / 4)
    return placed(
        turned([(0, low), (radius, low), (radius, high - edge), (radius - edge, high), (0, high)], sections),
        shift(*centre),
    )


def link(length: float, widths: tuple[float, float], low: float, high: float) -> trimesh.Trimesh:
    """Build a flat link from the origin to (length, 0) with round ends and straight flanks, m."""
    first, last = widths[0] / 2, widths[1] / 2
    # where the straight flanks are tangent to the round ends
    lean = np.arcsin(np.clip((first - last) / length, -1, 1))
    start = np.linspace(np.pi, np.pi / 2 - lean, 13)[:-1]
    end = np.linspace(np.pi / 2 - lean, 0, 13)[1:]
    steps = np.linspace(0, 1, 1 + int(np.ceil(length / LONGEST)))
    rise = np.array([np.sin(lean), np.cos(lean)])
    flank = first * rise + steps[:, None] * ([length, 0] + (last - first) * rise)
    upper = np.vstack(
        [
            first * np.stack([np.cos(start), np.sin(start)], axis=1),
            flank,
            [length, 0] + last * np.stack([np.cos(end), np.sin(end)], axis=1),
        ]
    )
    lower = upper * [1, -1]
    top = np.stack([np.insert(lower, 2, high, axis=1), np.insert(upper, 2, high, axis=1)], axis=1)
    bottom = np.stack([np.insert(upper, 2, low, axis=1), np.insert(lower, 2, low, axis=1)], axis=1)
    edge = np.vstack([upper, lower[-2::-1]])
    along = np.roll(edge[:-1], -1, axis=0) - np.roll(edge[:-1], 1, axis=0)
    outward = np.stack([-along[:, 1], along[:, 0], np.zeros(len(along))], axis=1)
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    outward = np.vstack([outward, outward[:1]])
    wall = np.stack([np.insert(edge, 2, high, axis=1), np.insert(edge, 2, low, axis=1)], axis=1)
    up = np.array([0.0, 0.0, 1.0])
    return joined(
        [
            woven(top, np.broadcast_to(up, top.shape)),
            woven(bottom, np.broadcast_to(-up, bottom.shape)),
            woven(wall, np.broadcast_to(outward[:, None], wall.shape)),
        ]
    )


def tube(path: Floats, radius: float, sides: int) -> trimesh.Trimesh:
    """Build a round wire along a path (n, 3), m, with open ends."""
    tangent = np.gradient(path, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    # one axis of each cross-section lies in the plane spanned by x, the path's axis, and the tangent
    one = np.cross(tangent, [1.0, 0.0, 0.0])
    straight = np.linalg.norm(one, axis=1) < 1e-6
    one[straight] = [0.0, 0.0, 1.0]
    one /= np.linalg.norm(one, axis=1, keepdims=True)
    other = np.cross(tangent, one)
    angles = np.linspace(0, 2 * np.pi, sides + 1)
    angles[-1] = 0.0
    outward = np.cos(angles)[:, None, None] * one + np.sin(angles)[:, None, None] * other
    return woven(path + radius * outward, outward)


def annulus(inner: float, outer: float, z: float, sections: int = 288) -> trimesh.Trimesh:
    """Build a flat ring, or a disc if `inner` is 0, that faces along +z, m.

    With 288 sections its area is 8e-5 smaller than the circle's.
    """
    return turned([(outer, z), (inner, z)], sections)


def woven(grid: Floats, normals: Floats) -> trimesh.Trimesh:
    """Join a grid of points (n, m, 3) by triangles that face along the cross product of its first and second axis."""
    rows, columns = grid.shape[:2]
    here = np.arange(rows * columns).reshape(rows, columns)[:-1, :-1].ravel()
    right, up = here + columns, here + 1
    faces = np.vstack([np.column_stack([here, right, right + 1]), np.column_stack([here, right + 1, up])])
    points = grid.reshape(-1, 3)
    corners = points[faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return _mesh(points, normals.reshape(-1, 3), faces[area > 1e-15])  # no slivers where a circle is a point


def joined(meshes: Sequence[trimesh.Trimesh]) -> trimesh.Trimesh:
    """Join meshes without merging their vertices."""
    firsts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    return _mesh(
        np.vstack([mesh.vertices for mesh in meshes]),
        np.vstack([mesh.vertex_normals for mesh in meshes]),
        np.vstack([mesh.faces + first for mesh, first in zip(meshes, firsts, strict=True)]),
    )


def placed(mesh: trimesh.Trimesh, pose: Floats) -> trimesh.Trimesh:
    """Return a mesh moved by a rigid pose (4, 4)."""
    return _mesh(mesh.vertices @ pose[:3, :3].T + pose[:3, 3], mesh.vertex_normals @ pose[:3, :3].T, mesh.faces)


def shift(x: float, y: float, z: float = 0.0) -> Floats:
    """Return the pose (4, 4) of a translation, m."""
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    return pose


def turn(about: Floats | tuple[float, float], angle: float) -> Floats:
    """Return the pose (4, 4) of a body with its origin at `about`, m, turned by `angle`, rad."""
    pose = shift(float(about[0]), float(about[1]))
    pose[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return pose


def _mesh(vertices: Floats, normals: Floats, faces: NDArray[np.int64]) -> trimesh.Trimesh:
    return trimesh.Trimesh(vertices, faces, vertex_normals=normals, process=False)
