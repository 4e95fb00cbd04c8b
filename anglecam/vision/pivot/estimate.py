"""The pivot: a round marker, the centre of rotation of the mark's path, or both together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anglecam.data.typing import Floats
from anglecam.vision.pivot.circle import Circle
from anglecam.vision.pivot.marker import RoundMarker

_SURE_RADIUS = 0.2
"""Relative uncertainty of the path's radius above which its centre says nothing."""
_DISAGREE = 9.21
"""99 % point of χ² with two degrees of freedom."""


@dataclass(frozen=True)
class PivotEstimate:
    """Where the mechanism turns."""

    centre_px: Floats
    """(2,) px."""
    covariance_px2: Floats
    """(2, 2) px²."""
    source: str
    """``marker``, ``centre of rotation`` or ``marker and centre of rotation``."""


def combine_pivot(marker: RoundMarker | None, circle: Circle | None) -> tuple[PivotEstimate | None, str | None]:
    """Join marker and centre of rotation, each by its certainty, or take the motion's word where they disagree.

    Parameters
    ----------
    marker : Marker, optional
        The round mark, if one was found.
    circle : Circle, optional
        The mouth's path, if it moved.

    Returns
    -------
    pivot : Pivot or None
        ``None`` where there is neither.
    note : str or None
        What to report where they disagree by more than their uncertainties: then the centre of rotation is taken,
        because about it the mouth keeps its distance.
    """
    if circle is not None and not circle.covariance_px2[2, 2] < (_SURE_RADIUS * circle.radius_px) ** 2:
        circle = None
    if circle is None:
        return (None if marker is None else PivotEstimate(marker.centre_px, marker.covariance_px2, "marker")), None
    turned = PivotEstimate(circle.centre_px, circle.centre_covariance_px2, "centre of rotation")
    if marker is None:
        return turned, None
    apart = marker.centre_px - circle.centre_px
    spread = marker.covariance_px2 + circle.centre_covariance_px2
    if apart @ np.linalg.solve(spread, apart) > _DISAGREE:
        distance, sigma = float(np.hypot(*apart)), float(np.sqrt(np.trace(spread) / 2.0))
        return turned, (
            f"marker and centre of rotation are {distance:.2f} px apart (uncertainty {sigma:.2f} px);"
            " the centre of rotation is used"
        )
    information = np.linalg.inv(marker.covariance_px2) + np.linalg.inv(circle.centre_covariance_px2)
    covariance = np.linalg.inv(information)
    centre = marker.centre_px - marker.covariance_px2 @ np.linalg.solve(spread, apart)
    return PivotEstimate(centre, covariance, "marker and centre of rotation"), None
