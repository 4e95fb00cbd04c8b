"""Find the mark in a few frames of a clip: the blob of the right hue that travels on a circle.

At first only a hue is known, so blobs are thresholded at several levels of it. Other objects share the hue: a mug on
the table has it but does not move, a toy that swings past moves but keeps no constant distance from the pivot, and a
face moves with the mark but is less red. The remaining blobs are ranked by how often they are seen, how constant their
size is, and how strongly their hue stands out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats, Image
from anglecam.vision.mark.blob_tracks import BlobTrack, moving_track, resting_track
from anglecam.vision.mark.blobs import find_blobs
from anglecam.vision.mark.colour import ColourModel, chroma_of, hue_contrast, learn_colour

_LEVEL_SHARES = (0.3, 0.4, 0.5, 0.6, 0.7)
"""Thresholds for blobs, as shares of the way from the picture's usual hue contrast to its highest."""
_MIN_CONTRAST = 8.0
"""Units of a*, b* by which the mark's hue must stand out; JPEG's chroma errors reach 3 or 4."""
_TOP_PX = 40
"""The highest hue contrast is that of the 40th pixel, which excludes the codec's outliers."""
_MAX_NOISE, _MAX_NOISE_DECLARED = 0.15, 0.4
"""Largest standard deviation of the surroundings' fraction of mark at which mark and surroundings are distinct. Where
the colour is declared and the mark has it, the mark may stand out less, as brick-red lips on brown skin do."""
_HUE_TOLERANCE = np.radians(25.0)


@dataclass(frozen=True)
class FoundMark:
    """The mark as the search found it."""

    model: ColourModel
    """Its colour, learnt from the clip."""
    area_px2: float
    """Its typical area, coarse, px²."""
    place_px: Floats
    """(2,) its median place in the plane of motion, px."""
    circle: tuple[Floats, float] | None
    """Coarse centre and radius of its path, px; ``None`` where it does not move."""


def find_mark(
    images: Sequence[Image],
    rgb: tuple[int, int, int] | None,
    near_px: Floats | None,
    to_plane: Callable[[int, Floats], Floats],
) -> FoundMark | None:
    """Find the mark and learn its colour from frames spread over a clip.

    Parameters
    ----------
    images : sequence of ndarray
        (h, w, 3) frames, blue, green, red.
    rgb : tuple of int, optional
        The declared colour, accurate to some tens of grey levels. Without it the mark is the reddest thing, as opposed
        to skin, that moves.
    near_px : ndarray, optional
        (2,) hint at the pivot in the plane of motion, px. Where nothing rotates around it, other centres are tried.
    to_plane : callable
        Maps (i, point), a point (2,) of the i-th picture, to the plane of motion, in which paths are circles, px.

    Returns
    -------
    FoundMark or None
        ``None`` where no hue stands out, or where the only thing that stands out is at rest while other things move.
    """
    maps = [cv2.GaussianBlur(hue_contrast(image, rgb), (0, 0), 1.0) for image in images]
    at_rest = not _something_moves(images)
    usual, top = _hue_range(maps, at_rest)
    if top - usual < _MIN_CONTRAST:
        return None
    thresholded = []
    for share in _LEVEL_SHARES:
        level = usual + share * (top - usual)
        if level - usual >= _MIN_CONTRAST / 2.0:
            thresholded.append((level, find_blobs(maps, level, usual, to_plane)))
    # The hint misleads where a slanted view shows the marker on the shaft far from the centre of rotation.
    for hint in (near_px,) if near_px is None else (near_px, None):
        tracks: list[BlobTrack | None] = []
        for level, blobs in thresholded:
            tracks.append(moving_track(blobs, images, level, hint))
            if at_rest:
                tracks.append(resting_track(blobs, images, level))
        for track in sorted((t for t in tracks if t is not None), key=lambda t: -t.score):
            model = _learn(images, maps, track, _MAX_NOISE if rgb is None else _MAX_NOISE_DECLARED)
            if model is None or (rgb is not None and not _same_hue(model.chroma, chroma_of(rgb))):
                continue
            area, place = track.blobs.area[track.members], track.blobs.plane_px[track.members]
            return FoundMark(model, float(np.median(area)), np.median(place, axis=0), track.circle)
    return None


def _hue_range(maps: Sequence[NDArray[Any]], at_rest: bool) -> tuple[float, float]:
    """Return the usual hue contrast of the picture and the highest one, of moving pixels where there are enough."""
    stack_max = np.maximum.reduce(list(maps))
    change = stack_max - np.minimum.reduce(list(maps))
    usual = float(np.median(maps[0]))
    # Moving pixels set the scale, because a static thing may be far redder than the mark.
    moving = stack_max[change > _MIN_CONTRAST]
    top = moving if moving.size >= _TOP_PX and not at_rest else stack_max.ravel()
    return usual, float(np.partition(top, -_TOP_PX)[-_TOP_PX])


def _something_moves(images: Sequence[Image]) -> bool:
    """Return whether more pixels change than a mark covers, apart from flicker of the light."""
    small = [cv2.GaussianBlur(cv2.cvtColor(i, cv2.COLOR_BGR2GRAY), (0, 0), 2.0)[::2, ::2].astype(float) for i in images]
    median = np.median(small, axis=0)
    for picture in small:
        gain = np.median((picture + 1.0) / (median + 1.0))
        if (np.abs(picture - gain * median) > 12.0).mean() > 1e-3:
            return True
    return False


def _learn(
    images: Sequence[Image], maps: Sequence[NDArray[Any]], track: BlobTrack, max_noise: float
) -> ColourModel | None:
    """Learn the colour from a track's blobs; ``None`` where they do not stand out from their neighbourhood."""
    inside, around, elsewhere, contrast = [], [], [], []
    for m in track.members:
        t = int(track.blobs.frame[m])
        coloured = (maps[t] > track.level).astype(np.uint8)
        _, labels = cv2.connectedComponents(coloured, connectivity=8)
        blob = (labels == track.blobs.label[m]).astype(np.uint8)
        core = cv2.erode(blob, np.ones((3, 3), np.uint8))
        core = core if core.sum() >= 6 else blob
        # Edge pixels belong to neither. Beyond them lies a collar as wide as the mark, without other blobs.
        grown = cv2.dilate(blob, np.ones((9, 9), np.uint8))
        wide = 2 * max(8, round(float(np.sqrt(blob.sum())) / 2.0)) + 1
        collar: Image = cv2.dilate(grown, np.ones((wide, wide), np.uint8)) - grown
        near_coloured: Image = cv2.dilate(coloured, np.ones((9, 9), np.uint8))
        collar = collar & (1 - near_coloured)
        inside.append(images[t][core > 0])
        around.append(images[t][collar > 0])
        if collar.any():
            contrast.append(float(np.median(maps[t][core > 0]) - np.median(maps[t][collar > 0])))
        rest = np.s_[::8, ::8]
        elsewhere.append(images[t][rest][near_coloured[rest] == 0])
    parts = [np.concatenate(p).astype(float) for p in (inside, around, elsewhere)]
    # The contrast to the collar excludes a blush: it stands out from the wall, but not from the face.
    if min(map(len, parts)) < 20 or np.median(contrast) < _MIN_CONTRAST:
        return None
    model = learn_colour(*parts)
    return model if model.noise < max_noise else None


def _same_hue(chroma: Floats, declared: Floats) -> bool:
    """Return whether a colour is the declared one up to shading, which scales (a*, b*) along the hue."""
    here, there = np.hypot(*chroma), np.hypot(*declared)
    angle = np.arctan2(chroma[1], chroma[0]) - np.arctan2(declared[1], declared[0])
    return bool(abs((angle + np.pi) % (2.0 * np.pi) - np.pi) < _HUE_TOLERANCE and 0.4 * there < here < 1.8 * there)
