"""Edge error of a renderer, measured on shapes whose pixel areas are known in closed form.

A bright half-plane and a bright disc stand before a dark sheet, square to the camera. Each pixel's share of brightness
is compared with the area of the shape in the pixel's square. An edge that is displaced by d px along its normal changes
a pixel by d times the length of edge in it. From the errors e of the pixels and the lengths l follow two distances:
sqrt(Σe²/Σl²), the RMS over the pixels, and Σel/Σl², the best-fitting displacement of the whole edge, which biases an
estimator.

The areas come from integrals derived here and share no code with the engines.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import trimesh
from numpy.typing import ArrayLike, NDArray

from synth.camera import Pinhole
from synth.draw.engine import Engine
from synth.mechanism import Part

Floats = NDArray[np.float64]
MakeEngine = Callable[[Sequence[Part], Pinhole, str, float], Engine]

_FOCAL, _DISTANCE = 2000.0, 1.5
_BEHIND = -0.01
"""z of the dark sheet, m."""
_GOLDEN = (math.sqrt(5) - 1) / 2
_SECTIONS = 1024
"""Sides of the disc's polygon: at 24 px radius they are within 1e-4 px of the circle, both inside and outside."""


@dataclass(frozen=True)
class EdgeError:
    """RMS errors of a renderer's edges, px."""

    half_plane_px: float
    """Displacement of a straight edge, pixel by pixel."""
    half_plane_fit_px: float
    """Displacement of a straight edge as a whole."""
    disc_px: float
    """Displacement of a circle's edge, pixel by pixel."""
    disc_centre_px: float
    """Displacement of a disc's centre of brightness in x and in y from that of the exact picture."""
    worst_px: float
    """Largest error of a pixel's share of brightness anywhere, as a displacement of an edge of 1 px length."""


def edge_error(
    make: MakeEngine, quality: str, size: tuple[int, int] = (96, 72), radius_px: float = 24.3, trials: int = 40
) -> EdgeError:
    """Measure an engine's edges.

    Parameters
    ----------
    make : callable
        Takes parts, camera, quality and gamma and returns the engine, for example `synth.draw.raster.Raster`. Its light
        may be quantised in steps of 1/255.
    quality : str
        Passed to the engine.
    size : tuple of int
        Size of the pictures; the disc must fit in them.
    radius_px : float
        Radius of the disc.
    trials : int
        Pictures of each shape, at evenly spread angles and subpixel positions.

    Returns
    -------
    EdgeError
        Errors in px.
    """
    camera = Pinhole(size, _FOCAL, ((size[0] - 1) / 2, (size[1] - 1) / 2), _DISTANCE, np.eye(3))
    spread = np.mod(0.5 + np.outer(np.arange(1, trials + 1), [_GOLDEN, _GOLDEN**2 + 0.1234, math.sqrt(2)]), 1.0)
    y, x = np.mgrid[: size[1], : size[0]].astype(float)

    straight, fits, worst = [], [], 0.0
    far = 4.0 * max(size)
    corners = np.array([[-far, -far], [0.0, -far], [0.0, far], [-far, far]])
    angles = 2 * math.pi * spread[:, 0]
    offsets = spread[:, 1:] - 0.5 + camera.principal_px
    normals = np.column_stack([np.cos(angles), np.sin(angles)])
    pictures = _pictures(make, quality, camera, _sheet(corners, camera), angles, offsets)
    for picture, normal, (u, v) in zip(pictures, normals, offsets, strict=True):
        distance = -((x - u) * normal[0] + (y - v) * normal[1])
        error, length = picture - half_plane_area(distance, normal), half_plane_chord(distance, normal)
        straight.append([(error**2).sum(), (length**2).sum()])
        fits.append((error * length).sum() / (length**2).sum())
        worst = max(worst, float(np.abs(error).max()))

    round_, centres = [], []
    turns = 2 * math.pi * np.arange(_SECTIONS) / _SECTIONS
    # the polygon has the circle's area
    reach = radius_px / math.sqrt(math.sin(2 * math.pi / _SECTIONS) / (2 * math.pi / _SECTIONS))
    disc = _sheet(reach * np.column_stack([np.cos(turns), np.sin(turns)]), camera)
    for picture, centre in zip(_pictures(make, quality, camera, disc, np.zeros(trials), offsets), offsets, strict=True):
        area = disc_area(x - centre[0], y - centre[1], radius_px)
        error = picture - area
        length = _disc_chord(x - centre[0], y - centre[1], radius_px)
        round_.append([(error**2).sum(), (length**2).sum()])
        drawn, exact = picture / picture.sum(), area / area.sum()
        centres.append([((drawn - exact) * x).sum(), ((drawn - exact) * y).sum()])
        worst = max(worst, float(np.abs(error).max()))
    return EdgeError(
        half_plane_px=_ratio(straight),
        half_plane_fit_px=float(np.sqrt(np.mean(np.square(fits)))),
        disc_px=_ratio(round_),
        disc_centre_px=float(np.sqrt(np.mean(np.square(centres)))),
        worst_px=worst,
    )


def half_plane_area(distance: ArrayLike, normal: ArrayLike) -> Floats:
    """Return the area of a unit square within a half-plane.

    The square's width along the normal n is the sum of two independent uniform variables of widths |nx| and |ny|;
    the area is the distribution function of that sum.

    Parameters
    ----------
    distance : array_like
        From the square's middle to the border, positive inside.
    normal : array_like
        (2,), of unit length.

    Returns
    -------
    ndarray
        0..1, shaped like `distance`.
    """
    d = np.asarray(distance, dtype=float)
    wide, narrow = np.sort(np.abs(np.asarray(normal, dtype=float)))[::-1]
    if narrow < 1e-7:
        return np.clip(d / wide + 0.5, 0.0, 1.0)
    below, far, near = np.abs(d), (wide + narrow) / 2, (wide - narrow) / 2
    # the area on the smaller side of the border
    corner = np.maximum(far - below, 0.0) ** 2 / (2 * wide * narrow)
    share = np.where(below >= near, corner, 0.5 - below / wide)
    return np.where(d > 0, 1.0 - share, share)


def half_plane_chord(distance: ArrayLike, normal: ArrayLike) -> Floats:
    """Return the length of a straight line within a unit square, the derivative of `half_plane_area`."""
    d = np.abs(np.asarray(distance, dtype=float))
    wide, narrow = np.sort(np.abs(np.asarray(normal, dtype=float)))[::-1]
    if narrow < 1e-7:
        return np.where(d <= wide / 2, 1.0 / wide, 0.0)
    return np.asarray(np.clip(((wide + narrow) / 2 - d) / (wide * narrow), 0.0, 1.0 / wide))


def disc_area(x: ArrayLike, y: ArrayLike, radius: float) -> Floats:
    """Return the area of unit squares within a disc about the origin.

    Parameters
    ----------
    x, y : array_like
        Centres of the squares.
    radius : float
        Radius of the disc.

    Returns
    -------
    ndarray
        0..1, shaped like `x`.
    """
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    left, right = x - 0.5, x + 0.5
    return _under_circle(left, right, y + 0.5, radius) - _under_circle(left, right, y - 0.5, radius)


def _under_circle(left: Floats, right: Floats, height: Floats, radius: float) -> Floats:
    """Return the disc's area between left and right and between the x axis and a height; negative below the axis."""
    h = np.minimum(np.abs(height), radius)
    corner = np.sqrt(radius**2 - h**2)  # where the circle falls below the height
    flat = h * (np.clip(right, -corner, corner) - np.clip(left, -corner, corner))
    falling = _circle_integral(np.maximum(right, corner), radius) - _circle_integral(np.maximum(left, corner), radius)
    rising = _circle_integral(np.minimum(right, -corner), radius) - _circle_integral(np.minimum(left, -corner), radius)
    return np.sign(height) * (flat + falling + rising)


def _circle_integral(x: Floats, radius: float) -> Floats:
    """Return ∫ √(r² − x²) dx from 0, constant beyond the circle."""
    s = np.clip(x / radius, -1.0, 1.0)
    return np.asarray(radius**2 / 2 * (s * np.sqrt(1 - s**2) + np.arcsin(s)))


def _disc_chord(x: Floats, y: Floats, radius: float) -> Floats:
    """Return the length of the circle in unit squares, approximated by the tangent nearest to their centres."""
    away = np.hypot(x, y)
    towards = np.arctan2(y, x)
    wide = np.maximum(np.abs(np.cos(towards)), np.abs(np.sin(towards)))
    narrow = np.maximum(np.minimum(np.abs(np.cos(towards)), np.abs(np.sin(towards))), 1e-7)
    return np.asarray(np.clip(((wide + narrow) / 2 - np.abs(away - radius)) / (wide * narrow), 0.0, 1.0 / wide))


def _ratio(sums: list[list[float]]) -> float:
    errors, lengths = np.sum(sums, axis=0)
    return float(math.sqrt(errors / lengths))


def _pictures(
    make: MakeEngine, quality: str, camera: Pinhole, shape: trimesh.Trimesh, angles: Floats, offsets: Floats
) -> list[Floats]:
    """Draw a bright shape at every place; return its share of brightness, (height, width) each."""
    reach = 20.0 * max(camera.size)
    dark = _sheet(np.array([[-reach, -reach], [reach, -reach], [reach, reach], [-reach, reach]]), camera)
    dark.apply_translation([0.0, 0.0, _BEHIND])
    parts = [_part("shape", "shape", shape, 255.0), _part("sheet", "ground", dark, 0.0)]
    engine = make(parts, camera, quality, 1.0)
    try:
        drawn = []
        for angle, (u, v) in zip(angles, offsets, strict=True):
            # rotated clockwise, because y points down in the picture, then translated
            pose = np.eye(4)
            pose[:2, :2] = [[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]]
            pose[:3, 3] = camera.place((float(u), float(v)), 0.0)
            poses: Mapping[str, Floats] = {"shape": pose, "ground": np.eye(4)}
            light = engine.draw(camera, poses, slice(0, camera.size[1])).astype(float).mean(axis=2)
            drawn.append((light - light.min()) / (light.max() - light.min()))
        return drawn
    finally:
        engine.close()


def _sheet(pixels: Floats, camera: Pinhole) -> trimesh.Trimesh:
    """Return a flat convex polygon in the plane of motion from its corners, px from the principal point, y down."""
    scale = camera.distance_m / camera.focal_px
    corners = np.column_stack([pixels * [scale, -scale], np.zeros(len(pixels))])
    middle = corners.mean(axis=0)
    around = np.arange(len(corners))
    faces = np.column_stack([np.full(len(corners), len(corners)), np.roll(around, -1), around])
    normals = np.tile([0.0, 0.0, 1.0], (len(corners) + 1, 1))
    return trimesh.Trimesh(np.vstack([corners, middle]), faces, vertex_normals=normals, process=False)


def _part(name: str, body: str, mesh: trimesh.Trimesh, grey: float) -> Part:
    return Part(name, body, mesh, np.full((len(mesh.vertices), 3), grey))
