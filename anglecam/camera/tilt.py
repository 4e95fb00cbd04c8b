"""The error of a declared tilt: what it does to the direction of a line in the plane of motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anglecam.data.typing import Floats


@dataclass(frozen=True)
class Tilt:
    """A view that was declared to be slanted, and how sure that is; see `anglecam.camera.lens`."""

    angle: float
    """Between the line of sight and the axis of rotation, undone in the angles, rad."""
    axis: float
    """Direction of the axis about which the camera is turned, counted as the line is, rad."""
    sigma: float
    """Standard uncertainty of ``angle``, rad."""

    def turned(self, line: Floats, error: float | Floats) -> Floats:
        """Return what a line of the square view becomes if the tilt is larger by ``error``, rad.

        Along the axis lengths are kept, across it they grow by cos τ / cos(τ + error); perspective moves a point on
        its line through the pivot and so leaves the direction alone.
        """
        from_axis = line - self.axis
        grown = np.cos(self.angle) / np.cos(self.angle + error)
        off = np.arctan2(grown * np.sin(from_axis), np.cos(from_axis)) - from_axis
        return line + (off + np.pi) % (2.0 * np.pi) - np.pi
