"""Patches of a picture in which one hue stands out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats

_MIN_AREA_PX2 = 12.0
"""A smaller patch has no centroid worth the name."""
_LARGEST_SHARE = 0.04
"""Of the picture; a mouth is smaller."""
_PER_FRAME = 12


@dataclass(frozen=True)
class Blobs:
    """The patches of many pictures; arrays of length n."""

    frame: NDArray[np.int64]
    """Number of the picture."""
    filmed: Floats
    """(n, 2) centre in the picture, px."""
    place: Floats
    """(n, 2) centre in the plane of motion, px."""
    area: Floats
    """px²."""
    contrast: Floats
    """By how much it stands out in hue, units of a*, b*."""
    label: NDArray[np.int64]
    """Its number among the picture's patches."""


def find_blobs(
    maps: Sequence[NDArray[Any]], level: float, usual: float, placed: Callable[[int, Floats], Floats]
) -> Blobs:
    """Cut the largest patches out of every picture.

    Parameters
    ----------
    maps : sequence of ndarray
        (h, w) hue contrast of each picture.
    level : float
        Contrast above which a pixel belongs to a patch.
    usual : float
        The picture's usual contrast.
    placed : callable
        Where a point (2,) of the i-th picture lies in the plane of motion, px.

    Returns
    -------
    Patches
        Those of no possible size left out.
    """
    frame, filmed, place, area, contrast, label = [], [], [], [], [], []
    for t, hue in enumerate(maps):
        _, _, stats, centres = cv2.connectedComponentsWithStats((hue > level).astype(np.uint8), connectivity=8)
        sizes = stats[:, cv2.CC_STAT_AREA]
        largest = _LARGEST_SHARE * hue.size
        fit = [k for k in np.argsort(-sizes) if k and _MIN_AREA_PX2 <= sizes[k] <= largest][:_PER_FRAME]
        for k in fit:
            x, y, w, h = stats[k, :4]
            part = hue[y : y + h, x : x + w]
            frame.append(t)
            filmed.append(centres[k])
            place.append(placed(t, centres[k]))
            area.append(sizes[k])
            contrast.append(np.percentile(part[part > level], 75) - usual)
            label.append(k)
    return Blobs(
        np.array(frame, np.int64),
        np.array(filmed, float).reshape(-1, 2),
        np.array(place, float).reshape(-1, 2),
        np.array(area, float),
        np.array(contrast, float),
        np.array(label, np.int64),
    )
