"""The centre of a mark's path, where the mark's own rotation contradicts it.

The circle through the centroids of a large mark, such as a hand or a whole body, is uncertain by more than its scatter
shows. Light that varies over the picture, or a background of the mark's colour, displaces the centroid along the mark
as it turns, and the circle absorbs that: it becomes too small or too large. The mark's own rotation does not depend on
the circle. If the mark turns by 1 + e times as much as the line to it, either may be right. Where e is larger than the
circle's uncertainty explains, the radius is uncertain by the share e.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from anglecam.vision.mark.outline_turn import outline_turn
from anglecam.vision.mark.segment import Region
from anglecam.vision.pivot.circle import Circle

_AGREE = 2.0
"""Standard uncertainties by which the two rotations may differ."""
_LEAST_LENGTH = 0.5
"""Least length L of such a mark, relative to the circle's radius R. An edge displaced by δ turns the mark's outline by
about δ/L and displaces its centroid by up to δ/2, which on an arc of ± θ changes the radius by about δ/θ². As shares of
the angle these are δ/(Lθ) and δ/(Rθ²): the outline is the surer one from L = θR on, half the radius at ± 29°."""
_HANGS = -0.5
"""Excess of the own rotation over the line's, as a share, below which the mark hangs from what turns, as the pan of a
balance does: its path is right, though it does not turn. It is nearer to -1, no rotation, than to 0, a rigid mark."""
_BAR = 12.0
"""Square of the length of a homogeneous bar, over the variance along it."""


def widened_by_own_rotation(circle: Circle, regions: Sequence[Region]) -> Circle:
    """Return a circle that is as uncertain as the rotation of a mark at least half as long as the circle's radius.

    A smaller mark's outline shows its rotation less well than its path does, because light and relief displace the
    edges, so that its path alone counts.

    Parameters
    ----------
    circle : Circle
        Fitted to the mark's path.
    regions : sequence of Region
        The mark in the frames in which it is wholly visible, in the plane of motion.

    Returns
    -------
    Circle
        With a larger covariance of centre and radius where the mark is long enough, and its own rotation is seen and
        differs from the line's by more than the uncertainties of both explain.
    """
    if not regions:
        return circle
    lengths2 = [_BAR * float(np.linalg.eigvalsh(region.moments_px2)[1]) for region in regions]
    if np.median(lengths2) < (_LEAST_LENGTH * circle.radius_px) ** 2:
        return circle
    arm = np.array([region.centre_px for region in regions]) - circle.centre_px
    found = outline_turn(regions, np.unwrap(np.arctan2(arm[:, 1], arm[:, 0])))
    if found is None or found[0] < _HANGS:
        return circle
    off, sigma = circle.radius_px * found[0], circle.radius_px * found[1]
    if off**2 <= _AGREE**2 * (circle.covariance_px2[2, 2] + sigma**2):
        return circle
    towards = arm.mean(axis=0) / max(float(np.hypot(*arm.mean(axis=0))), 1e-9)
    # a larger radius puts the centre farther from the path
    direction = np.append(-towards, 1.0)
    return replace(circle, covariance_px2=circle.covariance_px2 + off**2 * np.outer(direction, direction))
