"""How an error of the declared tilt changes the direction of a line in the plane of motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anglecam.data.typing import Floats


@dataclass(frozen=True)
class Tilt:
    """The declared tilt of a view and its uncertainty; see `anglecam.camera.lens`."""

    angle: float
    """Angle between the line of sight and the axis of rotation, rad; the measured angles are corrected for it."""
    axis: float
    """Direction of the axis about which the camera is turned, counted as the line is, rad."""
    sigma: float
    """Standard uncertainty of ``angle``, rad."""

    def turned(self, line: Floats, error: float | Floats) -> Floats:
        """Return the direction of a line of the rectified view if the tilt τ is larger by ``error``, rad.

        Lengths along the axis stay the same; lengths across it grow by cos τ / cos(τ + error). Perspective moves a
        point along its line through the pivot and so does not change the direction.
        """
        from_axis = line - self.axis
        grown = np.cos(self.angle) / np.cos(self.angle + error)
        off = np.arctan2(grown * np.sin(from_axis), np.cos(from_axis)) - from_axis
        return line + (off + np.pi) % (2.0 * np.pi) - np.pi
