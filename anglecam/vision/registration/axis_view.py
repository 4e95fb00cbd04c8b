"""The axis of rotation as the camera sees it: a line, on which every height has its centre of rotation."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from anglecam.camera.lens import Lens
from anglecam.data.typing import Floats

_OFF_CENTRE = 0.03
"""Standard uncertainty of the principal point of a camera that is not calibrated, as a share of the picture's width."""
_CALIBRATED = 0.005
"""The same of a calibrated camera, as a share of its focal length."""


@dataclass(frozen=True)
class AxisView:
    """The line."""

    parallax: Floats
    """(2,) displacement of the centre of rotation for each px of height; zero where all heights share one centre."""
    direction_sigma: float = 0.0
    """Standard uncertainty of the line's direction, rad; zero where it is declared."""

    @property
    def estimated(self) -> bool:
        """Whether the line's direction is uncertain and is estimated with the heights."""
        return self.direction_sigma > 0.0

    @property
    def aside(self) -> Floats:
        """(2,) displacement for each px of height and each rad of the line's direction."""
        return np.array([-self.parallax[1], self.parallax[0]])

    def turned(self, direction: float) -> AxisView:
        """Return the view with the line's direction changed by a small angle, rad."""
        return replace(self, parallax=self.parallax + direction * self.aside)


def axis_in_perspective(lens: Lens, size: tuple[int, int], pivot_px: Floats) -> AxisView:
    """Return how an axis parallel to the line of sight is seen: as a line from the pivot to the principal point.

    Points at the height z appear larger by the factor f/(f − z), so the centre is displaced by (pivot − principal
    point)·z/f. An undeclared focal length is taken to equal the picture's width: it only scales the heights.

    Parameters
    ----------
    lens : Lens
        Of a view without tilt.
    size : tuple of int
        Width and height of the picture, px.
    pivot_px : ndarray
        (2,) px.
    """
    if lens.calibration is not None:
        focal, principal = lens.calibration.focal_px, lens.calibration.camera_matrix[:2, 2]
        sigma = _CALIBRATED * focal
    else:
        focal, principal = lens.focal_px or float(size[0]), (np.array(size) - 1.0) / 2.0
        sigma = _OFF_CENTRE * size[0]
    arm = np.asarray(pivot_px - principal, dtype=float)
    length = float(np.hypot(*arm))
    along = arm / length if length > 0.0 else np.array([1.0, 0.0])
    # near the principal point the line is as long as the error of that point makes it
    apparent = float(np.hypot(length, sigma))
    return AxisView(along * apparent / focal, sigma / apparent)
