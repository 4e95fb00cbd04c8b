"""The stages of the mark search in one frame, by the functions that measure: threshold, Canny, fill, what was found."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from anglecam.camera.lens import Lens
from anglecam.data.typing import Image
from anglecam.vision.mark.found_mark import FoundMark, region_in_plane
from anglecam.vision.mark.segment import (
    LARGEST_SHARE,
    SMALLEST_SHARE,
    Patch,
    Region,
    fill_patch,
    find_patches,
    measure,
)
from anglecam.vision.mark.track import follow_mark

STAGES = ("fraction", "threshold", "edges", "fill")


@dataclass(frozen=True)
class LearntMark:
    """The mark as a clip's frames show it with the present settings."""

    found: FoundMark
    lens: Lens
    """From the picture to the plane of motion."""


def stage_picture(image: Image, mark: FoundMark, stage: str) -> Image:
    """Return what a stage of the search makes of a frame.

    Parameters
    ----------
    image : ndarray
        (h, w, 3) the frame: blue, green, red.
    mark : FoundMark
        Whose colour and size are looked for.
    stage : {'fraction', 'threshold', 'edges', 'fill'}
        ``fraction``: the share of mark in each pixel; ``threshold``: the pixels above one half; ``edges``: Canny's
        along each patch of fitting size; ``fill``: what the joined outlines enclose.

    Returns
    -------
    ndarray
        (h, w) bytes, dark to bright.
    """
    if stage == "fraction":
        return mark.model.fraction_map(image)
    if stage == "threshold":
        # the patches of the picture, those of a wrong size too
        some = find_patches(image, mark.model, (0.0, np.inf), mark.opening_px)
        return some[0].core * np.uint8(255) if some else np.zeros(image.shape[:2], np.uint8)
    drawn = np.zeros(image.shape[:2], np.uint8)
    for patch in _patches(image, mark):
        filled = fill_patch(patch)
        drawn[filled.part] |= (filled.edges if stage == "edges" else filled.filled) * np.uint8(255)
    return drawn


def found_in(image: Image, mark: LearntMark) -> dict[str, Any]:
    """Return the regions of a frame and which of them is the mark, as the page receives it.

    Parameters
    ----------
    image : ndarray
        (h, w, 3) the frame: blue, green, red.
    mark : LearntMark
        What is looked for.

    Returns
    -------
    dict
        ``status`` as in the series, judged by this frame alone; ``regions``, the mark first, each with ``centre_px``,
        ``area_px2``, ``outline_px``, and whether it is ``whole`` and the ``mark``.
    """
    found = [region for patch in _patches(image, mark.found) if (region := measure(patch, mark.found.model))]
    placed = [region_in_plane(region, mark.lens) for region in found]
    track = follow_mark([placed], np.zeros(1), mark.found)
    chosen = track.regions[0]
    of_mark = [chosen is not None and np.array_equal(chosen.centre_px, region.centre_px) for region in placed]
    regions = [_as_dict(region, is_mark) for region, is_mark in zip(found, of_mark, strict=True)]
    return {"status": track.status[0], "regions": sorted(regions, key=lambda region: not region["mark"])}


def _patches(image: Image, mark: FoundMark) -> list[Patch]:
    areas = SMALLEST_SHARE * mark.area_px2, LARGEST_SHARE * mark.area_px2
    return find_patches(image, mark.model, areas, mark.opening_px)


def _as_dict(region: Region, is_mark: bool) -> dict[str, Any]:
    return {
        "centre_px": region.centre_px.tolist(),
        "area_px2": region.area_px2,
        "outline_px": region.contour_px.tolist(),
        "whole": region.whole,
        "mark": bool(is_mark),
    }
