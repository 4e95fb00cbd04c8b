"""Blobs: connected patches of a picture in which one hue stands out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats
from anglecam.vision.mark.segment import Region

_MIN_AREA_PX2 = 12.0
"""Smallest blob with a useful centroid, px²."""
_MAX_AREA_SHARE = 0.04
"""Largest blob, as a share of the picture's area; a mark is smaller."""
_MAX_PER_PICTURE = 12


@dataclass(frozen=True)
class Blobs:
    """The blobs of many pictures; arrays of length n."""

    frame: NDArray[np.int64]
    """Index of the picture."""
    picture_px: Floats
    """(n, 2) centroid in the picture, px."""
    plane_px: Floats
    """(n, 2) centroid in the plane of motion, px."""
    area: Floats
    """px²."""
    contrast: Floats
    """Hue contrast over the picture's usual one, units of a*, b*."""
    label: NDArray[np.int64]
    """Label of the connected component in its picture."""


def find_blobs(
    maps: Sequence[NDArray[Any]], level: float, usual: float, to_plane: Callable[[int, Floats], Floats]
) -> Blobs:
    """Find the largest blobs of every picture by thresholding its hue contrast.

    Parameters
    ----------
    maps : sequence of ndarray
        (h, w) hue contrast of each picture.
    level : float
        Threshold: contrast above which a pixel belongs to a blob.
    usual : float
        The picture's usual contrast.
    to_plane : callable
        Maps (i, point), a point (2,) of the i-th picture, to the plane of motion, px.

    Returns
    -------
    Blobs
        At most twelve for each picture, without those that are too small or too large for a mark.
    """
    frame, picture_px, plane_px, area, contrast, label = [], [], [], [], [], []
    for t, hue in enumerate(maps):
        _, _, stats, centres = cv2.connectedComponentsWithStats((hue > level).astype(np.uint8), connectivity=8)
        sizes = stats[:, cv2.CC_STAT_AREA]
        largest = _MAX_AREA_SHARE * hue.size
        chosen = [k for k in np.argsort(-sizes) if k and _MIN_AREA_PX2 <= sizes[k] <= largest][:_MAX_PER_PICTURE]
        for k in chosen:
            x, y, w, h = stats[k, :4]
            part = hue[y : y + h, x : x + w]
            frame.append(t)
            picture_px.append(centres[k])
            plane_px.append(to_plane(t, centres[k]))
            area.append(sizes[k])
            contrast.append(np.percentile(part[part > level], 75) - usual)
            label.append(k)
    return Blobs(
        np.array(frame, np.int64),
        np.array(picture_px, float).reshape(-1, 2),
        np.array(plane_px, float).reshape(-1, 2),
        np.array(area, float),
        np.array(contrast, float),
        np.array(label, np.int64),
    )


def blobs_of_regions(regions: Sequence[Sequence[Region]]) -> Blobs:
    """Return the wholly visible regions of every picture, in the plane of motion, as blobs of equal contrast."""
    whole = [(t, region) for t, of_picture in enumerate(regions) for region in of_picture if region.whole]
    places = np.array([region.centre_px for _, region in whole]).reshape(-1, 2)
    return Blobs(
        frame=np.array([t for t, _ in whole], np.int64),
        picture_px=places,
        plane_px=places,
        area=np.array([region.area_px2 for _, region in whole]),
        contrast=np.ones(len(whole)),
        label=np.zeros(len(whole), np.int64),
    )
