"""The ideal camera: where a point of the rig appears in the picture.

A pinhole at (0, 0, D) looks along −z, straight down the shaft, and its principal point is the shaft's place in the
picture. Whatever turns about the shaft therefore turns about that one pixel, at every depth, by the same angle.
Pixel (0, 0) is the centre of the top left pixel, x to the right, y down.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

DISTANCE = 1.5
"""Camera to the plane of motion z = 0, m."""


@dataclass(frozen=True)
class Pinhole:
    """A camera that faces right; a rig that faces left is its mirror image."""

    size: tuple[int, int]
    """Width and height, px."""
    focal_px: float
    pivot_px: tuple[float, float]
    """Principal point, in the picture as it is written."""
    mirrored: bool
    """Whether the picture is turned about its vertical middle line at the end."""

    @property
    def drawn_pivot_px(self) -> tuple[float, float]:
        """Principal point before the picture is mirrored."""
        x, y = self.pivot_px
        return (self.size[0] - 1 - x if self.mirrored else x, y)

    def project(self, points: ArrayLike) -> Floats:
        """Pixels (…, 2) of points (…, 3) given in m."""
        x, y, z = np.moveaxis(np.asarray(points, dtype=float), -1, 0)
        scale = self.focal_px / (DISTANCE - z)
        sign = -1.0 if self.mirrored else 1.0
        return np.stack([self.pivot_px[0] + sign * scale * x, self.pivot_px[1] - scale * y], axis=-1)


def aim(size: tuple[int, int], lever_px: float, lever: float, pivot_px: tuple[float, float], mirrored: bool) -> Pinhole:
    """Choose the focal length at which a lever in the plane of motion measures `lever_px`.

    Parameters
    ----------
    size : tuple of int
        Width and height, px.
    lever_px : float
        What the lever shall measure, px.
    lever : float
        Its length, m.
    pivot_px : tuple of float
        Where the shaft shall appear, px.
    mirrored : bool
        Whether the face looks to the left.

    Returns
    -------
    Pinhole
        The camera.
    """
    return Pinhole(size, lever_px * DISTANCE / lever, pivot_px, mirrored)
