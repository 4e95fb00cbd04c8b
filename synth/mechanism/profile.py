"""A head's drawing as curves in metres: outline, coloured regions, strokes of relief and shade."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from synth.mechanism import drawings
from synth.mechanism.curves import MM, closed, ellipse, opened
from synth.mechanism.drawings import Drawing

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Stroke:
    """A soft line: its effect falls off with the distance d from its path as exp(−(d/width)²)."""

    path: Floats
    """(n, 2), samples closer together than the width, m."""
    width: float
    """m."""
    gain: Floats
    """Effect on the path itself: shape () for a height, () or (3,) for a colour."""

    def share(self, points: Floats) -> Floats:
        """Return the share of the stroke's gain at points (n, 2): (n,), 1 on its path."""
        away = cKDTree(self.path).query(points, distance_upper_bound=5 * self.width)[0]  # 1e-11 beyond
        return np.asarray(np.exp(-((away / self.width) ** 2)))


@dataclass(frozen=True)
class Profile:
    """A drawing ready for `inflate`."""

    outline: Floats
    """(n, 2), closed without repeating its first point, m."""
    regions: dict[str, Floats]
    """Name to closed curve; later regions lie on top of earlier ones."""
    relief: tuple[Stroke, ...] = ()
    shades: tuple[Stroke, ...] = ()


def head_profile(drawing: Drawing, nape: bool = False, spacing: float = 1.0 * MM) -> Profile:
    """Return the profile of a head.

    Parameters
    ----------
    drawing : Drawing
        The head's drawing.
    nape : bool
        Whether the nape is closed, as a person's, or open for the linkage.
    spacing : float
        Distance between neighbouring points of a curve, m.

    Returns
    -------
    Profile
        Outline, and the regions hair, ear, brow, eye, iris, pupil, lash, nostril, lips.
    """
    outline = closed([*drawing.face, *(drawing.nape if nape else drawing.skull)], spacing)
    fine = 0.6 * spacing
    regions = {
        "hair": closed(drawing.hair, spacing),
        "ear": closed(drawings.EAR, spacing),
        "brow": closed(drawing.brow, spacing),
        "eye": closed(drawings.EYE, fine),
        "iris": ellipse(*drawings.IRIS, fine),
        "pupil": ellipse(*drawings.PUPIL, fine),
        "lash": closed(drawing.lash, fine),
        "nostril": closed(drawing.nostril, fine),
        "lips": _lips(drawing, outline, spacing),
    }
    return Profile(
        outline,
        regions,
        tuple(_stroke(*stroke, spacing) for stroke in drawing.relief),
        tuple(_stroke(*stroke, spacing) for stroke in drawing.shades),
    )


def _stroke(path: drawings.Points, width: float, gain: float | tuple[float, float, float], spacing: float) -> Stroke:
    return Stroke(opened(path, 0.3 * spacing), width * MM, np.asarray(gain))


def _lips(drawing: Drawing, outline: Floats, spacing: float) -> Floats:
    """Close the lips along the outline's points, so that lips and skin share every vertex there."""
    top, bottom = (int(np.argmin(np.hypot(*(outline - np.array(drawing.lips[end]) * MM).T))) for end in (0, -1))
    front = outline[top : bottom + 1]
    inner = opened([tuple(front[0] / MM), *drawing.lips[1:-1], tuple(front[-1] / MM)], spacing)
    return np.vstack([inner[1:-1], front[::-1]])
