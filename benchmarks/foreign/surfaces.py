"""Shapes and colours that Mitsuba does not have ready-made: a head, a mottled wall, a ball's pattern.

A head is a star-shaped surface: its radius and its colour are functions of the direction from its middle. x points to
where the face looks, y upwards, z to the camera. Lengths are centimetres, colours are linear reflectances.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

Array = np.ndarray
_LATTICE = 64


@dataclass(frozen=True)
class Complexion:
    """Colours of a head."""

    skin: tuple[float, float, float] = (0.60, 0.38, 0.28)
    hair: tuple[float, float, float] = (0.10, 0.06, 0.04)
    lips: tuple[float, float, float] = (0.50, 0.05, 0.06)


def cloud(places: Array, per_unit: float, seed: int) -> Array:
    """Return smooth noise of unit variance at places (..., 3), with ``per_unit`` independent values per unit length."""
    lattice = np.random.default_rng(seed).normal(size=(_LATTICE,) * 3)
    at = np.moveaxis(places * per_unit, -1, 0)
    return np.asarray(map_coordinates(lattice, at, order=1, mode="grid-wrap"))


def _bump(directions: Array, towards: tuple[float, float, float], width: tuple[float, float, float]) -> Array:
    """Return a Gaussian hill of height 1 around a direction, with a width along each axis."""
    middle = np.array(towards) / np.linalg.norm(towards)
    return np.exp(-0.5 * (((directions - middle) / width) ** 2).sum(axis=-1))


HEAD_CM = (7.6, 8.8, 6.4)
MOUTH = (0.90, -0.42, 0.0)
"""Direction of the mouth from the head's middle."""
UPPER_LIP, LOWER_LIP = (0.915, -0.37, 0.0), (0.885, -0.475, 0.0)


def head_radius(directions: Array) -> Array:
    """Return the distance of the head's surface from its middle in the given directions (..., 3), cm."""
    ellipsoid = 1.0 / np.sqrt(((directions / HEAD_CM) ** 2).sum(axis=-1))
    nose = 1.9 * _bump(directions, (1.0, -0.1, 0.0), (0.3, 0.11, 0.13))
    lips = 0.75 * (_bump(directions, UPPER_LIP, (0.3, 0.04, 0.24)) + _bump(directions, LOWER_LIP, (0.3, 0.045, 0.22)))
    chin = 1.5 * _bump(directions, (0.74, -0.75, 0.0), (0.2, 0.15, 0.3))
    brow = 0.5 * _bump(directions, (0.9, 0.38, 0.0), (0.3, 0.08, 0.5))
    sockets = sum(-0.7 * _bump(directions, (0.83, 0.18, side), (0.12, 0.12, 0.15)) for side in (-0.5, 0.5))
    cheeks = sum(0.4 * _bump(directions, (0.65, -0.2, side), (0.2, 0.2, 0.2)) for side in (-0.7, 0.7))
    return np.asarray(ellipsoid + nose + lips + chin + brow + sockets + cheeks)


def head_colour(directions: Array, complexion: Complexion) -> Array:
    """Return the reflectance (..., 3) of the head in the given directions."""
    mottle = 0.06 * cloud(directions, 6.0, 1) + 0.05 * cloud(directions, 22.0, 2)
    freckles = 0.25 * np.clip(cloud(directions, 17.0, 3) - 1.8, 0.0, 1.0)
    colour = np.array(complexion.skin) * (1.0 + mottle - freckles)[..., None]
    lips = np.maximum(_bump(directions, UPPER_LIP, (0.3, 0.05, 0.24)), _bump(directions, LOWER_LIP, (0.3, 0.055, 0.22)))
    colour = _over(colour, np.array(complexion.lips) * (1 + 0.1 * cloud(directions, 20.0, 4))[..., None], lips > 0.45)
    white, iris = np.array([0.75, 0.74, 0.72]), np.array([0.03, 0.03, 0.04])
    for side in (-0.5, 0.5):
        colour = _over(colour, white, _bump(directions, (0.83, 0.18, side), (0.09, 0.05, 0.09)) > 0.5)
        colour = _over(colour, iris, _bump(directions, (0.85, 0.18, 0.9 * side), (0.04, 0.04, 0.04)) > 0.5)
        brow = _bump(directions, (0.83, 0.36, side), (0.15, 0.035, 0.22)) > 0.5
        colour = _over(colour, np.array(complexion.hair), brow)
    strands = cloud(directions * [1.0, 0.25, 1.0], 40.0, 5)
    hair = np.array(complexion.hair) * np.clip(1.0 + 0.5 * strands, 0.2, None)[..., None]
    return _over(colour, hair, directions @ [-0.55, 0.83, 0.0] > 0.18 + 0.04 * cloud(directions, 9.0, 6))


def _over(below: Array, above: Array, mask: Array) -> Array:
    return np.where(mask[..., None], above, below)


def sphere_directions(rows: int, columns: int) -> Array:
    """Return unit vectors (rows, columns, 3) of an equirectangular map whose seam points away from the camera."""
    polar = np.linspace(0.0, np.pi, rows)[:, None]
    around = np.linspace(0.0, 2.0 * np.pi, columns)[None]
    x, y, z = -np.sin(polar) * np.sin(around), np.cos(polar) + 0.0 * around, -np.sin(polar) * np.cos(around)
    return np.stack([x, y, z], axis=-1)


def write_star(path: Path, radius: Array, directions: Array) -> None:
    """Write a star-shaped surface sampled at ``directions`` (rows, columns, 3) as a binary PLY with normals and uv."""
    rows, columns = radius.shape
    places = radius[..., None] * directions
    down, across = np.gradient(places, axis=0), np.gradient(places, axis=1)
    normals = np.cross(down, across)
    normals *= np.sign((normals * directions).sum(-1, keepdims=True))
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    normals = np.where(length > 1e-9, normals / np.maximum(length, 1e-9), directions)
    v, u = np.meshgrid(np.linspace(0, 1, rows), np.linspace(0, 1, columns), indexing="ij")
    vertices = np.concatenate([places, normals, u[..., None], v[..., None]], axis=-1).reshape(-1, 8)
    first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    faces = np.concatenate(
        [
            np.column_stack([first, first + columns, first + 1]),
            np.column_stack([first + 1, first + columns, first + columns + 1]),
        ]
    )
    header = "\n".join(
        ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
        + [f"property float {name}" for name in ("x", "y", "z", "nx", "ny", "nz", "u", "v")]
        + [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header\n"]
    )
    table = np.empty(len(faces), dtype=[("n", "u1"), ("at", "<i4", 3)])
    table["n"], table["at"] = 3, faces
    path.write_bytes(header.encode() + vertices.astype("<f4").tobytes() + table.tobytes())


def mottled(rows: int, columns: int, base: tuple[float, float, float], strength: float, seed: int) -> Array:
    """Return a reflectance map (rows, columns, 3) with stains of several sizes and a few darker stripes."""
    rng = np.random.default_rng(seed)
    stains = sum(
        gaussian_filter(rng.normal(size=(rows, columns)), width, mode="wrap") * width for width in (2.0, 6.0, 18.0)
    )
    stripes = (np.arange(columns) // (columns // 9) % 2)[None] * 0.6
    grey = np.clip(1.0 + strength * (stains + stripes), 0.15, 1.6)
    return np.asarray(np.array(base) * grey[..., None])


def patterned(directions: Array, light: tuple[float, float, float], dark: tuple[float, float, float]) -> Array:
    """Return the reflectance (..., 3) of a ball with patches of two colours."""
    return _over(np.array(light) + 0.0 * directions, np.array(dark), cloud(directions, 3.0, 8) > 0.3)
