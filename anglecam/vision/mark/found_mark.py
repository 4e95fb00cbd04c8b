"""The mark as the search found it, and the frames in which it is sought."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from anglecam.camera.lens import Lens
from anglecam.data.typing import Floats, Image
from anglecam.vision.mark.colour import ColourModel
from anglecam.vision.mark.segment import Region


@dataclass(frozen=True)
class FoundMark:
    """The mark as the search found it."""

    model: ColourModel
    """Its colour, learnt from the clip."""
    area_px2: float
    """Its typical area, px²."""
    place_px: Floats
    """(2,) its median place in the plane of motion, px."""
    circle: tuple[Floats, float] | None
    """Coarse centre and radius of its path, px; ``None`` where it does not move."""
    cue: str
    """What it was found by: its ``declared``, ``pointed``, ``red`` or ``moving`` colour."""
    opening_px: int
    """Radius of the disc that fits everywhere into the mark, px; 0 where the mark has no thinner part to cut off."""
    score: float
    """Larger is more like a mark."""
    margin: float = float("inf")
    """Its score over that of the best rival at another place, infinite without a rival."""


@dataclass(frozen=True)
class Samples:
    """Some frames of a clip, and where the plane of motion is in each of them."""

    images: Sequence[Image]
    """(h, w, 3) blue, green, red."""
    stabilised: Sequence[Image]
    """The same as a camera at rest would show them."""
    time: Floats
    """(n,) s."""
    to_plane: Callable[[int, Floats], Floats]
    """Maps (i, point), a point (2,) of the i-th picture, to the plane of motion, in which paths are circles, px."""
    in_plane: Callable[[int, Region], Region]
    """The same for a region of the i-th picture."""
    pointed_px: Floats | None = None
    """(4,) box in the first of these pictures in which somebody pointed at the mark: left, top, right, bottom, px; a
    point is a box without extent."""


def region_in_plane(region: Region, lens: Lens) -> Region:
    """Return a region of the picture as it lies in the plane of motion; its contour stays that of the picture."""
    if lens.is_identity:
        return region
    J = lens.jacobian(region.centre_px)
    return replace(
        region,
        centre_px=lens.rectify(region.centre_px),
        area_px2=region.area_px2 * float(np.linalg.det(J)),
        moments_px2=J @ region.moments_px2 @ J.T,
        noise_px2=J @ region.noise_px2 @ J.T,
    )
