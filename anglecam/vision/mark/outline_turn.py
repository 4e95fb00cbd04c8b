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
    fitted = _fitted(regions, line)
    if fitted is None:
        return None
    shapes, share, rest = fitted
    variance = float(rest @ rest) / (len(rest) - 3) * np.linalg.inv(shapes.T @ shapes)[0, 0]
    return float(share[0]), float(np.sqrt(variance))


def outline_bend(regions: Sequence[Region], line: Floats) -> float | None:
    """Return by how much the mark's longer axis turns otherwise than any view of a rigid mark explains.

    A view changes how far the axis turns, evenly or with a curvature. The rest is of things that bend, such as two
    links that are taken for one mark. Only that part of it counts which neighbouring frames share: the mean product of
    a frame's rest with the next one's is free of noise.

    Parameters
    ----------
    regions, line
        As for `outline_turn`.

    Returns
    -------
    float or None
        RMS, rad; ``None`` as from `outline_turn`.
    """
    fitted = _fitted(regions, line)
    if fitted is None:
        return None
    rest = fitted[2]
    return float(np.sqrt(max(float((rest[1:] * rest[:-1]).mean()), 0.0)))


def _fitted(regions: Sequence[Region], line: Floats) -> tuple[Floats, Floats, Floats] | None:
    """Fit the axis' excess rotation by a parabola of the line's; return its terms (n, 3), factors and rest (n,)."""
    if len(regions) < _MIN_FRAMES or np.ptp(line) == 0.0:
        return None
    moments = np.array([region.moments_px2 for region in regions])
    small, large = np.median(np.linalg.eigvalsh(moments), axis=0)
    if large < _ROUND_ASPECT**2 * small:
        return None
    # The direction of an axis has period π: halve the unwrapped double angle from it to the line, which hardly changes
    # between two frames, however far both turn.
    double = np.arctan2(2.0 * moments[:, 0, 1], moments[:, 0, 0] - moments[:, 1, 1])
    off = np.unwrap(double - 2.0 * line) / 2.0
    turn = line - np.median(line)
    shapes = np.column_stack([turn, np.ones(len(turn)), turn**2])
    if np.linalg.matrix_rank(shapes) < shapes.shape[1]:
        return None
    share = np.linalg.lstsq(shapes, off, rcond=None)[0]
    return shapes, share, off - shapes @ share
