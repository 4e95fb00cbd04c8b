"""Smooth plane curves through a few points of a drawing. Points are in mm, curves in m."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

Floats = NDArray[np.float64]
Points = Sequence[tuple[float, float]]

MM = 1e-3


def closed(points_mm: Points, spacing: float) -> Floats:
    """Return a closed smooth curve through the points.

    Parameters
    ----------
    points_mm : sequence of tuple of float
        (x, y), mm, the first not repeated.
    spacing : float
        Largest distance between neighbouring samples, m.

    Returns
    -------
    ndarray
        (n, 2), m, the first not repeated.
    """
    knots = np.array([*points_mm, points_mm[0]]) * MM
    along = _chord(knots)
    fine = CubicSpline(along, knots, bc_type="periodic")(np.linspace(0, along[-1], 40 * len(knots)))
    return _resample(fine, spacing)[:-1]


def opened(points_mm: Points, spacing: float) -> Floats:
    """Return a smooth curve from the first point to the last; a single point stays a point. Otherwise as `closed`."""
    knots = np.array(points_mm, dtype=float) * MM
    if len(knots) == 1:
        return knots
    along = _chord(knots)
    return _resample(CubicSpline(along, knots)(np.linspace(0, along[-1], 40 * len(knots))), spacing)


def ellipse(centre_mm: tuple[float, float], radii_mm: tuple[float, float], spacing: float) -> Floats:
    """Return an ellipse with axes along x and y; otherwise as `closed`."""
    count = int(np.ceil(2 * np.pi * max(radii_mm) * MM / spacing))
    turns = np.linspace(0.0, 2 * np.pi, count, endpoint=False)
    return MM * (np.asarray(centre_mm) + np.asarray(radii_mm) * np.stack([np.cos(turns), np.sin(turns)], axis=1))


def inside(curve: Floats, points: Floats) -> NDArray[np.bool_]:
    """Return which points lie inside a closed curve, by the parity of crossings to their right."""
    found = np.zeros(len(points), dtype=bool)
    near = np.flatnonzero(((points >= curve.min(axis=0)) & (points <= curve.max(axis=0))).all(axis=1))
    (x0, y0), (x1, y1) = curve.T, np.roll(curve, -1, axis=0).T
    for block in np.array_split(near, 1 + len(near) // 2000):  # blocks limit the memory of points × edges
        x, y = points[block, :1], points[block, 1:]
        spans = (y0 > y) != (y1 > y)
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing = x0 + (y - y0) * (x1 - x0) / (y1 - y0)
        found[block] = (spans & (x < crossing)).sum(axis=1) % 2 == 1
    return found


def _chord(points: Floats) -> Floats:
    # the square root of the chord keeps the spline from overshooting where short and long chords meet
    return np.concatenate([[0.0], np.cumsum(np.sqrt(np.hypot(*np.diff(points, axis=0).T)))])


def _resample(points: Floats, spacing: float) -> Floats:
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    even = np.linspace(0.0, along[-1], 1 + int(np.ceil(along[-1] / spacing)))
    return np.stack([np.interp(even, along, points[:, k]) for k in (0, 1)], axis=1)
