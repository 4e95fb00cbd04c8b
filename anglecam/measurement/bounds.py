"""Worst cases: the largest error of the angle for a mark, or a mark and a pivot, misplaced by at most so many pixels.

The paper allows the mark to be misplaced by 6 px to 10 px and states 0.28° and 0.68° for it (Section on Fig. 8).
No single lever arm gives both: as worst cases they belong to arms of 1228 px and 842.5 px, and at 842.5 px an error
of 6 px gives at most 0.408°. The 0.28° is one particular point on the circle of possible positions; here the worst of
them is computed, at the measured arm. A worst case is not an uncertainty (`anglecam.measurement.sigma`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def worst_case(radius_px: float, lever_px: ArrayLike) -> NDArray[np.float64]:
    """Return the largest angle error of a lever with one end anywhere within a circle: asin(r/R).

    The line from the pivot deviates most from the true direction where it is tangent to the circle around the true
    point.

    Parameters
    ----------
    radius_px : float
        Radius r of the circle around the true mark point, px.
    lever_px : array_like
        Lever arm R, pivot to mark, px; NaN stays NaN.

    Returns
    -------
    ndarray
        rad, in the shape of ``lever_px``; π where the circle reaches the pivot, because any direction is possible then.
    """
    return _asin_or_pi(radius_px, lever_px)


def worst_case_both_ends(radius_px: float, lever_px: ArrayLike) -> NDArray[np.float64]:
    """Return the largest angle error with pivot and mark each anywhere within a circle: asin(2r/R).

    Parameters
    ----------
    radius_px : float
        Radius r of both circles, px.
    lever_px : array_like
        Lever arm R, px; NaN stays NaN.

    Returns
    -------
    ndarray
        rad, in the shape of ``lever_px``; π where the circles meet.
    """
    return _asin_or_pi(2.0 * radius_px, lever_px)


def _asin_or_pi(reach_px: float, lever_px: ArrayLike) -> NDArray[np.float64]:
    lever = np.asarray(lever_px, float)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = reach_px / lever
    angle = np.arcsin(np.clip(ratio, 0.0, 1.0))
    return np.where(ratio >= 1.0, np.pi, angle)
