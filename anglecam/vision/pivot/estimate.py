"""The pivot: a round marker, the centre of rotation of the mark's path, or the combination of both."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anglecam.data.typing import Floats
from anglecam.vision.pivot.circle import Circle
from anglecam.vision.pivot.marker import RoundMarker

_MAX_RADIUS_SIGMA = 0.2
"""Relative uncertainty of the path's radius above which its centre is ignored."""
_DISAGREE = 9.21
"""99 % point of χ² with two degrees of freedom."""


@dataclass(frozen=True)
class PivotEstimate:
    """The pivot with its uncertainty."""

    centre_px: Floats
    """(2,) px."""
    covariance_px2: Floats
    """(2, 2) px²."""
    source: str
    """``marker``, ``centre of rotation`` or ``marker and centre of rotation``."""


def combine_pivot(marker: RoundMarker | None, circle: Circle | None) -> tuple[PivotEstimate | None, str | None]:
    """Combine marker and centre of rotation by inverse covariance; where they disagree, take the centre of rotation.

    Parameters
    ----------
    marker : RoundMarker, optional
        The round marker, if one was found.
    circle : Circle, optional
        The mark's path, if the mark moved.

    Returns
    -------
    pivot : PivotEstimate or None
        ``None`` where there is neither.
    note : str or None
        Message for the user where the two disagree by more than their uncertainties. The centre of rotation is then
        used, because the mark keeps a constant distance from it.
    """
    if circle is not None and not circle.covariance_px2[2, 2] < (_MAX_RADIUS_SIGMA * circle.radius_px) ** 2:
        circle = None
    if circle is None:
        return (None if marker is None else PivotEstimate(marker.centre_px, marker.covariance_px2, "marker")), None
    from_path = PivotEstimate(circle.centre_px, circle.centre_covariance_px2, "centre of rotation")
    if marker is None:
        return from_path, None
    difference = marker.centre_px - circle.centre_px
    spread = marker.covariance_px2 + circle.centre_covariance_px2
    if difference @ np.linalg.solve(spread, difference) > _DISAGREE:
        distance, sigma = float(np.hypot(*difference)), float(np.sqrt(np.trace(spread) / 2.0))
        return from_path, (
            f"marker and centre of rotation are {distance:.2f} px apart (uncertainty {sigma:.2f} px);"
            " the centre of rotation is used"
        )
    information = np.linalg.inv(marker.covariance_px2) + np.linalg.inv(circle.centre_covariance_px2)
    covariance = np.linalg.inv(information)
    centre = marker.centre_px - marker.covariance_px2 @ np.linalg.solve(spread, difference)
    return PivotEstimate(centre, covariance, "marker and centre of rotation"), None
