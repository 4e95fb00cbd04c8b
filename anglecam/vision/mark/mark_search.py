"""The regions of the mark's colour in one frame after another, looked for where the mark is expected first.

Two frames in which the mark is the only thing of its kind predict where the next one shows it. A region that is found
there whole, alone and of the same size is the mark. Where there is none, and in every sixteenth frame, the whole
picture is searched, so that other things of the mark's colour are known.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from anglecam.data.typing import Floats, Image
from anglecam.vision.mark.found_mark import FoundMark
from anglecam.vision.mark.segment import LARGEST_SHARE, MARGIN_PX, SMALLEST_SHARE, Region, find_regions

Part = tuple[slice, slice]
WHOLE_EVERY = 16
"""In frames whose number is a multiple of this, nothing of the frames before is used."""
_SAME_AREA = 1.4
"""Largest ratio of the areas of a mark in two frames: light and motion blur change it slowly."""
_FREE_PX = 8.0
"""Largest difference between the place that two frames predict and the mark's, at low speed, px."""
_FREE_SHARE = 0.5
"""The same relative to the last displacement: the acceleration of one frame interval."""
_NO_SPEED_PX = 24.0
"""The same where only one place is known."""


class MarkSearch:
    """Finds the regions of the mark's colour; remembers the last two places of the mark.

    Parameters
    ----------
    found : FoundMark
        Colour and size, from a sample of frames.
    is_mark : callable, optional
        Whether a region may be the mark by its size and place. Without it, whole pictures are searched.
    """

    def __init__(self, found: FoundMark, is_mark: Callable[[Region], bool] | None = None) -> None:
        self._found, self._is_mark = found, is_mark
        self._areas = SMALLEST_SHARE * found.area_px2, LARGEST_SHARE * found.area_px2
        self._last: Region | None = None
        self._step: Floats | None = None

    def regions(self, index: int, size: tuple[int, int], colours_in: Callable[[Part], Image]) -> list[Region]:
        """Return the regions of the mark's colour in the next frame.

        Parameters
        ----------
        index : int
            Number of the frame.
        size : tuple of int
            Width and height of the picture, px.
        colours_in : callable
            The (h, w, 3) colours, blue, green, red, of a part of the picture.

        Returns
        -------
        list of Region
            The mark alone where it was found where it was expected; else all of the picture, largest first.
        """
        if index % WHOLE_EVERY == 0:
            self.lose()
        mark, expected = None, self._last is not None
        if expected:
            mark = self._near(self._last, size, colours_in)  # type: ignore[arg-type]
        jumped = expected and mark is None
        regions = [mark] if mark is not None else self._in_part(_whole(size), colours_in)
        if self._is_mark is None:
            return regions
        if mark is None:
            likely = [region for region in regions if self._is_mark(region)]
            mark = likely[0] if len(likely) == 1 and likely[0].whole else None
        goes_on = mark is not None and self._last is not None and not jumped
        self._step = mark.centre_px - self._last.centre_px if goes_on else None  # type: ignore[union-attr]
        self._last = mark
        return regions

    def lose(self) -> None:
        """Forget the last places."""
        self._last = self._step = None

    def _near(self, last: Region, size: tuple[int, int], colours_in: Callable[[Part], Image]) -> Region | None:
        """Return the mark near its expected place; ``None`` unless it is there as it was in the last frame."""
        step = np.zeros(2) if self._step is None else self._step
        free = _NO_SPEED_PX if self._step is None else _FREE_PX + _FREE_SHARE * float(np.hypot(*step))
        # a region is measured with a margin, in which other regions count
        margin = MARGIN_PX + self._found.opening_px + 2
        low = np.floor(last.contour_px.min(axis=0) + step - free - margin).astype(int)
        high = np.ceil(last.contour_px.max(axis=0) + step + free + margin).astype(int) + 1
        left, top = np.maximum(low, 0).tolist()
        right, bottom = np.minimum(high, size).tolist()
        if left >= right or top >= bottom:
            return None
        regions = self._in_part((slice(top, bottom), slice(left, right)), colours_in)
        if len(regions) != 1 or not regions[0].whole or self._is_mark is None or not self._is_mark(regions[0]):
            return None
        region = regions[0]
        ends = np.array([left, top]), np.array([right, bottom])
        inside = (region.contour_px.min(axis=0) - margin >= ends[0]) | (ends[0] == 0)
        inside &= (region.contour_px.max(axis=0) + margin < ends[1]) | (ends[1] == size)
        alike = 1.0 / _SAME_AREA < region.area_px2 / last.area_px2 < _SAME_AREA
        return region if alike and inside.all() else None

    def _in_part(self, part: Part, colours_in: Callable[[Part], Image]) -> list[Region]:
        regions = find_regions(colours_in(part), self._found.model, self._areas, self._found.opening_px)
        start = np.array([part[1].start, part[0].start])
        return [
            replace(region, centre_px=region.centre_px + start, contour_px=region.contour_px + start.astype(np.int32))
            for region in regions
        ]


def _whole(size: tuple[int, int]) -> Part:
    return slice(0, size[1]), slice(0, size[0])
