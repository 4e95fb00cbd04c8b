"""The drawn head: its outline in profile and the regions of its face, as smooth closed curves.

The face looks along +x, y is up, the shaft is the origin; lengths in metres. The mouth stands about 120 mm in front
of the shaft and level with it, as in the paper's Fig. 7.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

Floats = NDArray[np.float64]

MM = 1e-3

_OUTLINE_MM = [
    (20, 152), (58, 147), (88, 129), (105, 104), (111, 86), (112.5, 77), (110, 67), (115.5, 56), (126, 44),
    (137, 33.5), (139, 28.5), (134, 23), (124.5, 20.5), (118.5, 17), (117.5, 12), (121, 7.5), (121.8, 4),
    (117.2, 0), (120.6, -4), (119.6, -8.5), (113.8, -13.5), (110.8, -19), (113.5, -28), (114, -38), (107, -48.5),
    (93, -53), (68, -47), (42, -38), (20, -27), (0, -22), (-15, -16), (-21, 2), (-23, 30), (-31, 50), (-52, 59),
    (-76, 62), (-85, 79), (-80, 106), (-61, 132), (-28, 148),
]  # fmt: skip
"""Crown, forehead, nose, lips, chin, jaw, the open nape where the linkage works, back of the skull."""

_LIP_TOP_MM, _LIP_BOTTOM_MM = (117.5, 12.0), (114.0, -13.3)
_LIP_INNER_MM = [(111, 10.5), (103.5, 5.5), (96, -1), (103, -9), (110, -13.5)]
"""From the upper edge of the lips through the corner of the mouth to the lower edge."""

_EYE_MM = [(102.5, 66.5), (98, 70.5), (91, 70), (84.5, 65.5), (91, 62.5), (98.5, 63)]
_BROW_MM = [(107.5, 83), (98, 87.5), (84, 83), (83.5, 80), (97, 83), (106, 79.5)]
_NOSTRIL_MM = [(130.5, 25.5), (126.5, 27), (123.5, 25), (126.5, 23.8)]
_HAIR_MM = [
    (101, 118), (84, 111), (66, 96), (50, 66), (44, 40), (36, 36), (34, 62), (20, 72), (-2, 62), (-8, 40), (-24, 38),
    (-60, 30), (-110, 60), (-110, 130), (-60, 175), (30, 185), (90, 160), (108, 135),
]  # fmt: skip
_EAR_MM = [(24, 66), (12, 70), (0, 62), (0, 46), (8, 30), (17, 28), (17, 40), (25, 52)]


@dataclass(frozen=True)
class Profile:
    """The outline and, in it, the regions that differ in colour."""

    outline: Floats
    """(n, 2), counter-clockwise or not, closed without repeating its first point, m."""
    regions: dict[str, Floats]
    """Name to closed curve; later ones lie on top of earlier ones."""


def head_profile(spacing: float = 1.0 * MM) -> Profile:
    """Draw the head.

    Parameters
    ----------
    spacing : float
        Distance between neighbouring points of a curve, m.

    Returns
    -------
    Profile
        Outline, and the regions hair, ear, brow, eye, iris, pupil, nostril, lips.
    """
    outline = _smooth(_OUTLINE_MM, spacing)
    iris, pupil = (circle((97.2 * MM, 66.7 * MM), radius * MM, spacing / 2) for radius in (3.4, 1.6))
    regions = {
        "hair": _smooth(_HAIR_MM, spacing),
        "ear": _smooth(_EAR_MM, spacing),
        "brow": _smooth(_BROW_MM, spacing),
        "eye": _smooth(_EYE_MM, spacing),
        "iris": iris,
        "pupil": pupil,
        "nostril": _smooth(_NOSTRIL_MM, spacing),
        "lips": _lips(outline, spacing),
    }
    return Profile(outline, regions)


def circle(centre: tuple[float, float], radius: float, spacing: float) -> Floats:
    """Points on a circle, `spacing` apart or a little less, m."""
    angles = np.linspace(0.0, 2 * np.pi, int(np.ceil(2 * np.pi * radius / spacing)), endpoint=False)
    return np.asarray(centre) + radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)


def inside(curve: Floats, points: Floats) -> NDArray[np.bool_]:
    """Tell which points lie inside a closed curve, by the parity of crossings to their right."""
    x, y = points[:, :1], points[:, 1:]
    (x0, y0), (x1, y1) = curve.T, np.roll(curve, -1, axis=0).T
    spans = (y0 > y) != (y1 > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = x0 + (y - y0) * (x1 - x0) / (y1 - y0)
    return np.asarray((spans & (x < crossing)).sum(axis=1) % 2 == 1)


def _lips(outline: Floats, spacing: float) -> Floats:
    """Close the lips over the outline's own points, so that lips and skin share every vertex there."""
    top, bottom = (
        int(np.argmin(np.hypot(*(outline - np.array(point) * MM).T))) for point in (_LIP_TOP_MM, _LIP_BOTTOM_MM)
    )
    front = outline[top : bottom + 1]
    knots = np.vstack([front[0], np.array(_LIP_INNER_MM) * MM, front[-1]])
    inner = _resample(CubicSpline(_chord(knots), knots)(np.linspace(0, _chord(knots)[-1], 400)), spacing)
    return np.vstack([inner[1:-1], front[::-1]])


def _smooth(points_mm: Sequence[tuple[float, float]], spacing: float) -> Floats:
    """Draw a closed cubic spline through the points, sampled evenly."""
    knots = np.array([*points_mm, points_mm[0]]) * MM
    along = _chord(knots)
    fine = CubicSpline(along, knots, bc_type="periodic")(np.linspace(0, along[-1], 40 * len(knots)))
    return _resample(fine, spacing)[:-1]


def _chord(points: Floats) -> Floats:
    # the square root of the chord keeps the spline from overshooting where short and long chords meet
    return np.concatenate([[0.0], np.cumsum(np.sqrt(np.hypot(*np.diff(points, axis=0).T)))])


def _resample(points: Floats, spacing: float) -> Floats:
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    even = np.linspace(0.0, along[-1], 1 + int(np.ceil(along[-1] / spacing)))
    return np.stack([np.interp(even, along, points[:, k]) for k in (0, 1)], axis=1)
