"""The mark's path as some frames of a clip show it: which regions of another frame may be the mark."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from anglecam.camera.lens import Lens
from anglecam.data.typing import Floats
from anglecam.vision.mark.segment import Region
from anglecam.vision.mark.track import COARSE_PX

_LIKE = 2.0
"""Largest ratio of the mark's area to that in other frames."""


@dataclass(frozen=True)
class MarkPath:
    """The circle on which a mark moves, and its size."""

    centre_px: Floats
    """(2,) in the plane of motion."""
    radius_px: float
    area_px2: float
    """The mark's."""
    lens: Lens
    """From the picture to the plane of motion."""

    def is_mark(self, region: Region) -> bool:
        """Return whether a region of the picture may be the mark by its place and size."""
        off = abs(float(np.hypot(*(self.lens.rectify(region.centre_px) - self.centre_px))) - self.radius_px)
        return off < COARSE_PX and self.area_px2 / _LIKE < region.area_px2 < _LIKE * self.area_px2

    def marks(self, regions: Sequence[Region]) -> list[Region]:
        """Return the regions that may be the mark."""
        return [region for region in regions if self.is_mark(region)]

    def direction(self, region: Region, pivot_px: Floats) -> float:
        """Return the direction from a pivot in the plane of motion to a region, counter-clockwise as seen, rad."""
        x, y = self.lens.rectify(region.centre_px) - pivot_px
        return float(np.arctan2(-y, x))
