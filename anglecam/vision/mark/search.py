"""Find the mouth in a few frames of a clip: the patch of the right hue that travels on a circle.

Nothing is known yet but a hue, so patches are cut out at several levels of it. A mug on the table has the mouth's
colour but stays; a toy that swings by moves but keeps no distance from the pivot; a face moves with the mouth but
is less red. What is left is told by how often it is seen, how constant it is in size, and how it stands out.
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
"""Shares of the way from the picture's usual hue to its most mouth-like one at which patches are cut out."""
_LEAST_CONTRAST = 8.0
"""Units of a*, b* by which the mouth's hue must stand out; JPEG's own chroma errors reach 3 or 4."""
_TOP_PX = 40
"""The most mouth-like hue is that of the 40th pixel, past the codec's outliers."""
_MOST_NOISE, _MOST_NOISE_DECLARED = 0.15, 0.4
"""Standard deviation of the surroundings' fraction of mouth above which they and the mouth are one; a mouth of the very
colour that is declared may stand out less, as brick-red lips on brown skin do."""
_HUE_TOLERANCE = np.radians(25.0)


@dataclass(frozen=True)
class FoundMark:
    """The mouth as the search found it."""

    model: ColourModel
    """Its colour, learnt from the clip."""
    area_px2: float
    """Its typical area in pixels, coarse."""
    place_px: Floats
    """(2,) its median place, px."""
    circle: tuple[Floats, float] | None
    """Coarse centre and radius of its path, px; ``None`` where it does not move."""


def find_mark(
    images: Sequence[Image],
    rgb: tuple[int, int, int] | None,
    near_px: Floats | None,
    placed: Callable[[int, Floats], Floats],
) -> FoundMark | None:
    """Find the mouth and learn its colour from frames spread over a clip.

    Parameters
    ----------
    images : sequence of ndarray
        (h, w, 3) frames, blue, green, red.
    rgb : tuple of int, optional
        The declared colour, good to some tens of grey levels; without it the mouth is the reddest thing, as
        against skin, that moves.
    near_px : ndarray, optional
        (2,) a hint at the pivot, in the plane of motion, px; where nothing turns about it, what turns about another.
    placed : callable
        Where a point (2,) of the i-th picture lies in the plane of motion, in which paths are circles, px.

    Returns
    -------
    Found or None
        ``None`` where nothing stands out in hue, or what does stand still while other things move.
    """
    maps = [cv2.GaussianBlur(hue_contrast(image, rgb), (0, 0), 1.0) for image in images]
    at_rest = not _something_moves(images)
    usual, top = _hue_range(maps, at_rest)
    if top - usual < _LEAST_CONTRAST:
        return None
    cuts = []
    for share in _LEVEL_SHARES:
        level = usual + share * (top - usual)
        if level - usual >= _LEAST_CONTRAST / 2.0:
            cuts.append((level, find_blobs(maps, level, usual, placed)))
    # a hint misleads where a slanted view shows the mark on a shaft far from what it turns about
    for hint in (near_px,) if near_px is None else (near_px, None):
        tracks: list[BlobTrack | None] = []
        for level, patches in cuts:
            tracks.append(moving_track(patches, images, level, hint))
            if at_rest:
                tracks.append(resting_track(patches, images, level))
        for track in sorted((one for one in tracks if one is not None), key=lambda t: -t.score):
            model = _learn(images, maps, track, _MOST_NOISE if rgb is None else _MOST_NOISE_DECLARED)
            if model is None or (rgb is not None and not _same_hue(model.chroma, chroma_of(rgb))):
                continue
            area, place = track.patches.area[track.members], track.patches.place[track.members]
            return FoundMark(model, float(np.median(area)), np.median(place, axis=0), track.circle)
    return None


def _hue_range(maps: Sequence[NDArray[Any]], at_rest: bool) -> tuple[float, float]:
    """Return the usual hue contrast of the picture, and the top one: of what changes, if enough does."""
    stack_max = np.maximum.reduce(list(maps))
    change = stack_max - np.minimum.reduce(list(maps))
    usual = float(np.median(maps[0]))
    # What moves sets the scale, for a static thing may be far redder than the mouth.
    moving = stack_max[change > _LEAST_CONTRAST]
    top = moving if moving.size >= _TOP_PX and not at_rest else stack_max.ravel()
    return usual, float(np.partition(top, -_TOP_PX)[-_TOP_PX])


def _something_moves(images: Sequence[Image]) -> bool:
    """Tell whether more than a mouth's worth of pixels changes, flicker of the light left out."""
    small = [cv2.GaussianBlur(cv2.cvtColor(i, cv2.COLOR_BGR2GRAY), (0, 0), 2.0)[::2, ::2].astype(float) for i in images]
    median = np.median(small, axis=0)
    for picture in small:
        gain = np.median((picture + 1.0) / (median + 1.0))
        if (np.abs(picture - gain * median) > 12.0).mean() > 1e-3:
            return True
    return False


def _learn(
    images: Sequence[Image], maps: Sequence[NDArray[Any]], track: BlobTrack, most_noise: float
) -> ColourModel | None:
    """Learn the colour from a track's patches; ``None`` where they do not stand out from what is next to them."""
    inside, around, elsewhere, contrast = [], [], [], []
    for m in track.members:
        t = int(track.patches.frame[m])
        red = (maps[t] > track.level).astype(np.uint8)
        _, labels = cv2.connectedComponents(red, connectivity=8)
        own = (labels == track.patches.label[m]).astype(np.uint8)
        core = cv2.erode(own, np.ones((3, 3), np.uint8))
        core = core if core.sum() >= 6 else own
        # Edge pixels are neither; then a collar as wide as the mouth, without other patches of the colour.
        grown = cv2.dilate(own, np.ones((9, 9), np.uint8))
        wide = 2 * max(8, round(float(np.sqrt(own.sum())) / 2.0)) + 1
        collar: Image = cv2.dilate(grown, np.ones((wide, wide), np.uint8)) - grown
        red_too: Image = cv2.dilate(red, np.ones((9, 9), np.uint8))
        collar = collar & (1 - red_too)
        inside.append(images[t][core > 0])
        around.append(images[t][collar > 0])
        if collar.any():
            contrast.append(float(np.median(maps[t][core > 0]) - np.median(maps[t][collar > 0])))
        rest = np.s_[::8, ::8]
        elsewhere.append(images[t][rest][red_too[rest] == 0])
    parts = [np.concatenate(p).astype(float) for p in (inside, around, elsewhere)]
    # A blush stands out from the wall, but not from the face.
    if min(map(len, parts)) < 20 or np.median(contrast) < _LEAST_CONTRAST:
        return None
    model = learn_colour(*parts)
    return model if model.noise < most_noise else None


def _same_hue(chroma: Floats, declared: Floats) -> bool:
    """Tell whether a colour is the declared one but for shading, which moves a*, b* along the hue."""
    here, there = np.hypot(*chroma), np.hypot(*declared)
    angle = np.arctan2(chroma[1], chroma[0]) - np.arctan2(declared[1], declared[0])
    return bool(abs((angle + np.pi) % (2.0 * np.pi) - np.pi) < _HUE_TOLERANCE and 0.4 * there < here < 1.8 * there)
