"""Segment an image into regions of the mark's colour: the paper's threshold, Canny, fill, contour (Fig. 8 c–f).

The contour determines which pixels belong together. The position is then computed from the grey levels: it is the
centroid of the fraction of mark in each pixel. The fraction locates the edge to a small part of a pixel, which a filled
outline does not.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from anglecam.data.typing import Floats, Image
from anglecam.vision.mark.colour import EMPTY_LEVEL, FULL_LEVEL, ColourModel
from anglecam.vision.mark.cover import connected_tail, cover_weight

SMALLEST_SHARE, LARGEST_SHARE = 0.25, 8.0
"""Of the mark's area; a smaller region is not the mark, even if partly hidden, nor is a larger one, even if merged."""
MARGIN_PX = 12
"""Margin around a region, px, that contains the foot of its edges."""
_FOOT_PX = 3
"""Reach of a filmed edge from the half level, px: optics, chroma at half resolution, a codec's ringing."""
_BELOW_HALF = np.ceil((EMPTY_LEVEL + FULL_LEVEL) / 2.0) - 1.0
"""Highest grey level of a pixel that the mark covers by less than half."""
_MIN_OUTLINE_PX = 8
"""A patch with a shorter outline is a speck."""
_SPECK_SHARE = 0.03
"""Share of a region's area: touching patches that are smaller in total do not count as another region."""
_MAX_REGIONS = 12
"""Patches of one frame that are measured, largest first."""


@dataclass(frozen=True)
class Region:
    """One connected region of the mark's colour in one frame."""

    centre_px: Floats
    """(2,) centroid of the fraction of mark, px."""
    area_px2: float
    """Sum of that fraction, px²."""
    moments_px2: Floats
    """(2, 2) second central moments of that fraction, px²."""
    noise_px2: Floats
    """(2, 2) covariance of the centroid for pixel noise of one grey level, px²."""
    contour_px: NDArray[Any]
    """(k, 2) outline after threshold, Canny and fill."""
    whole: bool
    """False where the region touches the picture's edge or another region."""


@dataclass(frozen=True)
class Patch:
    """A patch of the mark's colour that is not measured yet."""

    fraction: Image
    """(h, w) fraction map of the whole picture."""
    smooth: Image
    """The same without single pixels' noise."""
    core: Image
    """(h, w) bytes: 1 in the patches of the picture."""
    contour_px: NDArray[Any]
    """(k, 1, 2) outline."""
    cut: bool
    """Whether it touches the picture's edge; its region is then not whole."""


@dataclass(frozen=True)
class FilledPatch:
    """A patch after threshold, Canny and fill; the pictures show the patch and a margin, bytes of 0 or 1."""

    part: tuple[slice, slice]
    """Rows and columns of the whole picture that they show."""
    inner: Image
    """The thresholded patch alone."""
    edges: Image
    """Canny edges along it."""
    outline_px: NDArray[Any]
    """(k, 1, 2) outer contour of both, px of this part."""
    filled: Image
    """Everything within the contour."""


def find_regions(image: Image, model: ColourModel, areas_px2: tuple[float, float], opening_px: int = 0) -> list[Region]:
    """Find the regions of the mark's colour in an image.

    Parameters
    ----------
    image : ndarray
        (h, w, 3) blue, green, red.
    model : ColourModel
        The mark's colour.
    areas_px2 : tuple of float
        Regions with a smaller or a larger area within the contour of the half level are left out.
    opening_px : int
        Radius of a disc that must fit into a region everywhere; thinner parts, such as the thread of a ball, are cut
        off.

    Returns
    -------
    list of Region
        Largest first, at most 12.
    """
    measured = (measure(patch, model) for patch in find_patches(image, model, areas_px2, opening_px))
    return [region for region in measured if region is not None]


def find_patches(image: Image, model: ColourModel, areas_px2: tuple[float, float], opening_px: int = 0) -> list[Patch]:
    """Find the patches that `find_regions` measures; parameters and order are the same."""
    fraction = model.fraction_map(image)
    smooth = cv2.GaussianBlur(fraction, (3, 3), 0)
    _, core = cv2.threshold(smooth, _BELOW_HALF, 1, cv2.THRESH_BINARY)
    compact = cv2.morphologyEx(core, cv2.MORPH_OPEN, disc(opening_px)) if opening_px else core
    outlines, _ = cv2.findContours(compact, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    sized = sorted(((cv2.contourArea(o), k) for k, o in enumerate(outlines) if len(o) >= _MIN_OUTLINE_PX), reverse=True)
    least, most = areas_px2
    likely = [outlines[k] for area, k in sized[:_MAX_REGIONS] if least <= area <= most]
    return [Patch(fraction, smooth, compact, outline, _is_cut(outline, fraction)) for outline in likely]


def _is_cut(outline: NDArray[Any], picture: Image) -> bool:
    left, top, across, down = cv2.boundingRect(outline)
    height, width = picture.shape
    return left <= 0 or top <= 0 or left + across >= width or top + down >= height


def fill_patch(patch: Patch) -> FilledPatch:
    """Join a thresholded patch with the Canny edges along it, and fill the outer contour."""
    height, width = patch.fraction.shape
    left, top, across, down = cv2.boundingRect(patch.contour_px)
    x0, y0 = max(left - MARGIN_PX, 0), max(top - MARGIN_PX, 0)
    rows = slice(y0, min(top + down + MARGIN_PX, height))
    columns = slice(x0, min(left + across + MARGIN_PX, width))
    part = rows, columns
    inner = np.zeros_like(patch.core[part])
    cv2.drawContours(inner, [patch.contour_px], -1, 1, cv2.FILLED, offset=(-x0, -y0))
    step = (FULL_LEVEL - EMPTY_LEVEL) / 2.0
    along: Image = cv2.dilate(inner, disc(1))
    edges = cv2.Canny(patch.smooth[part], step, 2.0 * step) // 255 & along
    contours, _ = cv2.findContours(inner | edges, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    outline = max(contours, key=len)
    filled = cv2.drawContours(np.zeros_like(inner), [outline], -1, 1, cv2.FILLED)
    return FilledPatch(part, inner, edges, outline, filled)


def measure(patch: Patch, model: ColourModel) -> Region | None:
    """Measure one patch; ``None`` where nothing of it remains after its neighbours are excluded."""
    fraction, smooth, core = patch.fraction, patch.smooth, patch.core
    shape = fill_patch(patch)
    box, inner, filled = shape.part, shape.inner, shape.filled
    start = np.array([box[1].start, box[0].start])
    others = core[box] & (1 - inner)
    reach = _reach(smooth[box], filled, model)
    near, touched = reach, False
    if others.any():
        near_others = cv2.dilate(others, disc(_FOOT_PX))
        # Specks of the colour are ignored: they come and go with the noise.
        touched = bool((others & cv2.dilate(reach, disc(_FOOT_PX))).sum() > _SPECK_SHARE * inner.sum())
        reach &= 1 - near_others
        near = reach | near_others
    low = min(0.4, max(0.1, 3.0 * model.noise))
    weight = cover_weight(fraction[box], cv2.erode(filled, disc(2)), near, reach, low)
    # A highlight or the teeth inside the outline belong to the mark: away from the edge the outline is filled.
    weight[cv2.erode(filled, disc(_FOOT_PX)) > 0] = 1.0

    of_weight, of_edge = _sums(weight)
    area = float(of_weight[0, 0])
    if area <= 0.0:
        return None
    centre = of_weight[0, 1:] / area
    slope = float(np.linalg.norm(model.weights)) / (1.0 - 2.0 * low)
    return Region(
        centre_px=centre + start,
        area_px2=area,
        moments_px2=_about(centre, of_weight) / area,
        noise_px2=(slope / area) ** 2 * _about(centre, of_edge),
        contour_px=(shape.outline_px.reshape(-1, 2) + start).astype(np.int32),
        whole=not (patch.cut or touched),
    )


@njit(inline="always")
def _add_row(sums, y, one, x1, x2):  # type: ignore[no-untyped-def]
    sums[0, 0] += one
    sums[0, 1] += x1
    sums[1, 1] += x2
    sums[0, 2] += one * y
    sums[1, 2] += x1 * y
    sums[2, 2] += one * y * y


@njit("(float32[:, ::1],)", cache=True, nogil=True)
def _sums(weight):  # type: ignore[no-untyped-def]
    """Return the sums of weights (h, w) by the products of 1, x and y, and those of the pixels between 0 and 1.

    Of each, an upper triangle (3, 3).
    """
    of_weight, of_edge = np.zeros((3, 3)), np.zeros((3, 3))
    for y in range(weight.shape[0]):
        one = x1 = x2 = edge = edge_x1 = edge_x2 = 0.0
        for x in range(weight.shape[1]):
            share = np.float64(weight[y, x])
            if share > 0.0:
                one, x1, x2 = one + share, x1 + share * x, x2 + share * x * x
                if share < 1.0:
                    edge, edge_x1, edge_x2 = edge + 1.0, edge_x1 + x, edge_x2 + x * x
        _add_row(of_weight, y, one, x1, x2)
        _add_row(of_edge, y, edge, edge_x1, edge_x2)
    return of_weight, of_edge


def _about(centre: Floats, sums: Floats) -> Floats:
    """Return the second moments (2, 2) about a centre (2,), of sums as from `_sums`."""
    (one, sum_x, sum_y), (_, sum_xx, sum_xy), (_, _, sum_yy) = sums.tolist()
    x, y = centre.tolist()
    xy = sum_xy - x * sum_y - y * sum_x + one * x * y
    return np.array([[sum_xx - 2.0 * x * sum_x + one * x * x, xy], [xy, sum_yy - 2.0 * y * sum_y + one * y * y]])


def _reach(smooth: Image, filled: Image, model: ColourModel) -> Image:
    """Return the pixels that may contain some of the region: its foot, and the tail that motion blur draws out."""
    low = EMPTY_LEVEL + max(0.25, 4.0 * model.noise) * (FULL_LEVEL - EMPTY_LEVEL)
    return cv2.dilate(connected_tail(smooth, filled, low), disc(_FOOT_PX))


@cache
def disc(radius_px: int) -> Image:
    """Return a filled disc as a structuring element, (2r + 1, 2r + 1)."""
    size = 2 * radius_px + 1
    return cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
