"""Whether the mouth turns with the line to it: as it must in a view that is square to the plane of motion.

In a slanted view a mouth stands out before the plane, and its outline turns by less or more than its place does; so it
does, by less, where a strong lens bends the picture.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from anglecam.data.typing import Floats
from anglecam.vision.mark.segment import Region

_FEWEST = 12
"""Frames."""
_ROUND = 1.1
"""Ratio of the axes below which an outline points nowhere."""


def outline_turn(regions: Sequence[Region], line: Floats) -> tuple[float, float] | None:
    """Tell by which share of the line's turn the mouth's longer axis turns more than the line.

    Parameters
    ----------
    regions : sequence of Region
        The mouth in n frames, in the plane of motion.
    line : ndarray
        (n,) direction from the centre of rotation to it, x to the right and y down, rad.

    Returns
    -------
    tuple of float or None
        The share and its standard uncertainty; ``None`` where the mouth is round, hardly turns or is hardly seen.
    """
    if len(regions) < _FEWEST or np.ptp(line) == 0.0:
        return None
    moments = np.array([region.moments_px2 for region in regions])
    small, large = np.linalg.eigvalsh(np.median(moments, axis=0))
    if large < _ROUND**2 * small:
        return None
    # an axis has no front: its direction comes again after half a turn
    axis = np.unwrap(np.arctan2(2.0 * moments[:, 0, 1], moments[:, 0, 0] - moments[:, 1, 1])) / 2.0
    turn = line - np.median(line)
    shapes = np.column_stack([turn, np.ones(len(turn)), turn**2])
    share, left = np.linalg.lstsq(shapes, axis - line, rcond=None)[:2]
    if not len(left):
        return None
    variance = float(left[0]) / (len(turn) - 3) * np.linalg.inv(shapes.T @ shapes)[0, 0]
    return float(share[0]), float(np.sqrt(variance))
