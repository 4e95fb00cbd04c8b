"""Whether the mark's outline rotates with the line from the pivot to the mark.

In a view square to the plane of motion the two rotate alike. In a slanted view a mark stands in front of the plane, and
its outline rotates less or more than the line to it. Where a strong lens distorts the picture, the outline rotates
less.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from anglecam.data.typing import Floats
from anglecam.vision.mark.segment import Region

_MIN_FRAMES = 12
_ROUND_ASPECT = 1.1
"""Ratio of the axes below which the outline is too round to have a direction."""


def outline_turn(regions: Sequence[Region], line: Floats) -> tuple[float, float] | None:
    """Return the relative excess of the rotation of the mark's longer axis over the rotation of the line to it.

    Parameters
    ----------
    regions : sequence of Region
        The mark in n frames, in the plane of motion.
    line : ndarray
        (n,) direction from the centre of rotation to the mark, x to the right and y down, rad.

    Returns
    -------
    tuple of float or None
        The excess and its standard uncertainty, both as a share of the line's rotation. ``None`` where the mark is
        round, hardly rotates or is seen in too few frames.
    """
    if len(regions) < _MIN_FRAMES or np.ptp(line) == 0.0:
        return None
    moments = np.array([region.moments_px2 for region in regions])
    small, large = np.median(np.linalg.eigvalsh(moments), axis=0)
    if large < _ROUND_ASPECT**2 * small:
        return None
    # The direction of an axis has period π: halve the unwrapped double angle.
    axis = np.unwrap(np.arctan2(2.0 * moments[:, 0, 1], moments[:, 0, 0] - moments[:, 1, 1])) / 2.0
    turn = line - np.median(line)
    shapes = np.column_stack([turn, np.ones(len(turn)), turn**2])
    share, squares = np.linalg.lstsq(shapes, axis - line, rcond=None)[:2]
    if not len(squares):
        return None
    variance = float(squares[0]) / (len(turn) - 3) * np.linalg.inv(shapes.T @ shapes)[0, 0]
    return float(share[0]), float(np.sqrt(variance))
