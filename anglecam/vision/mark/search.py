"""Find the mark in a few frames of a clip: the blob of one colour that travels on a circle.

At first only colours are known that the mark may have (`anglecam.vision.mark.cues`), so blobs are thresholded at
several levels of closeness to each. Other objects share the colour: a mug on the table has it but does not move, a toy
that swings past moves but keeps no constant distance from the pivot, and a face moves with the mark but is less red.
The remaining blobs are ranked by how often they are seen, how constant their size is, and how strongly they stand out.
Each cue's best is then found again by the colour learnt from it, as in the whole clip, and the marks compete.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from anglecam.data.series import OK
from anglecam.data.typing import Floats, Image
from anglecam.threads import map_in_threads
from anglecam.vision.image.median import median_picture
from anglecam.vision.mark.blob_tracks import BlobTrack, moving_track, resting_track
from anglecam.vision.mark.blobs import Blobs, blobs_of_regions, find_blobs
from anglecam.vision.mark.cues import RED, Cue, declared_cue, moving_cues, pointed_cues
from anglecam.vision.mark.found_mark import FoundMark, Samples
from anglecam.vision.mark.learn_colour import MIN_CONTRAST, is_same_colour, learn_colour
from anglecam.vision.mark.segment import LARGEST_SHARE, SMALLEST_SHARE, Patch, Region, disc, find_patches, measure
from anglecam.vision.mark.track import MarkTrack, follow_mark

_LEVEL_SHARES = (0.3, 0.4, 0.5, 0.6, 0.7)
"""Thresholds for blobs, as shares of the way from the picture's usual contrast to its highest."""
_TOP_PX = 40
"""The highest contrast is that of the 40th pixel, which excludes the codec's outliers."""
_MAX_NOISE, _MAX_NOISE_DECLARED = 0.15, 0.4
"""Largest standard deviation of the surroundings' fraction of mark at which mark and surroundings are distinct. Where
the colour is declared and the mark has it, the mark may stand out less, as brick-red lips on brown skin do."""
_LEAST_SHARE = 0.3
"""Share of the samples in which the mark must be found again, whole and on its circle."""
_LARGEST_SHARE = 0.06
"""Share of the picture's area above which a region is no mark: the whole face, where a part of it was found first."""
_STEADY = 20.0
"""Travel, in units of the scatter around the circle, at which a mark's score is halved. Filmed marks reach hundreds,
and ten where an undeclared tilt makes the circle an ellipse."""
_COMPACT_SHARE = 0.9
"""Share of a blob into which the opening's disc fits; with less, a thread or a rod is attached to it. Of an ellipse
three times as long as wide, as of lips, it is 0.98."""
_RED_PRIOR = 10.0
"""Factor of the red cue's score. The mark is usually a mouth; hair and a shirt move with it, are larger and stand out
more from the wall."""


def find_mark(
    samples: Samples, rgb: tuple[int, int, int] | None, near_px: Floats | None, *, any_colour: bool
) -> FoundMark | None:
    """Find the mark and learn its colour from frames spread over a clip.

    Parameters
    ----------
    samples : Samples
        Frames spread over the clip.
    rgb : tuple of int, optional
        The declared colour, accurate to some tens of grey levels. Without it the mark is the reddest thing, as opposed
        to skin, that moves, or a thing of any other colour that moves.
    near_px : ndarray, optional
        (2,) hint at the pivot in the plane of motion, px. Where nothing rotates around it, other centres are tried.
    any_colour : bool
        Whether an undeclared mark may have any colour that moves, or is red.

    Returns
    -------
    FoundMark or None
        ``None`` where no colour stands out, or where the only thing that stands out is at rest while other things move.
    """
    at_rest = not something_moves(samples.stabilised)
    if rgb is not None:
        cues = [declared_cue(rgb)]
    elif samples.pointed_px is not None:
        cues = pointed_cues(samples.images[0], samples.pointed_px)
    else:
        cues = [RED, *(moving_cues(samples.stabilised) if any_colour and not at_rest else [])]
    labs = map_in_threads(_lab_in_planes, samples.images)
    marks = map_in_threads(lambda cue: _mark_of_cue(cue, samples, labs, near_px, at_rest), cues)
    found = [mark for mark in marks if mark is not None]
    ranked = sorted(found, key=lambda mark: -mark.score)
    if not ranked:
        return None
    best = ranked[0]
    rivals = [mark.score for mark in ranked if np.hypot(*(mark.place_px - best.place_px)) > np.sqrt(best.area_px2)]
    return replace(best, margin=best.score / rivals[0]) if rivals else best


def _lab_in_planes(image: Image) -> Image:
    """Return an image in CIE Lab, (h, w, 3), bytes, each of the three stored by itself: they are faster to compare."""
    lab = cv2.cvtColor(image, cv2.COLOR_BGR2LAB, dst=np.empty_like(image))
    planes = np.empty((3, *image.shape[:2]), np.uint8)
    for k, plane in enumerate(planes):
        cv2.extractChannel(lab, k, dst=plane)
    return np.moveaxis(planes, 0, -1)


def _mark_of_cue(
    cue: Cue, samples: Samples, labs: Sequence[Image], near_px: Floats | None, at_rest: bool
) -> FoundMark | None:
    """Return the thing of one colour that is most like a mark; ``None`` where there is none.

    ``labs`` are the samples in CIE Lab.
    """
    images = samples.images
    maps = [cue.contrast(lab) for lab in labs]
    for contrast in maps:
        cv2.GaussianBlur(contrast, (0, 0), 1.0, dst=contrast)
    usual, top = _contrast_range(maps, at_rest)
    if top - usual < MIN_CONTRAST:
        return None
    levels = [usual + share * (top - usual) for share in _LEVEL_SHARES]
    levels = [level for level in levels if level - usual >= MIN_CONTRAST / 2.0]
    thresholded = list(zip(levels, find_blobs(maps, levels, usual, samples.to_plane), strict=True))
    # The hint misleads where a slanted view shows the marker on the shaft far from the centre of rotation.
    for hint in (near_px,) if near_px is None else (near_px, None):
        tracks: list[BlobTrack | None] = []
        for level, blobs in thresholded:
            through = None if samples.pointed_px is None else _pointed_blobs(blobs, maps[0], level, samples.pointed_px)
            tracks.append(moving_track(blobs, images, level, hint, on_body=cue.on_body, through=through))
            if at_rest:
                tracks.append(resting_track(blobs, images, level, through))
        for track in sorted((t for t in tracks if t is not None), key=lambda t: -t.score):
            model = learn_colour(images, maps, track, _MAX_NOISE_DECLARED if cue.name == "declared" else _MAX_NOISE)
            if model is None or (cue.name == "declared" and not is_same_colour(model, cue.rgb)):
                continue
            mark = FoundMark(model, *_typical(track), track.circle, cue.name, _opening(track, maps), track.score)
            if track.circle is None:
                return mark
            seen = _seen_again(mark, cue, float(np.median(track.blobs.contrast[track.members])), samples, hint)
            if seen is not None:
                return replace(seen, score=seen.score * _RED_PRIOR) if cue is RED else seen
    return None


def _typical(track: BlobTrack) -> tuple[float, Floats]:
    """Return the median area, px², and the median place, px, of a track's blobs."""
    members = track.members
    return float(np.median(track.blobs.area[members])), np.median(track.blobs.plane_px[members], axis=0)


def _pointed_blobs(blobs: Blobs, contrast: NDArray[Any], level: float, box_px: Floats) -> NDArray[np.intp]:
    """Return the indices of the first picture's blobs that lie in a box, at least in part."""
    _, labels = cv2.connectedComponents((contrast > level).astype(np.uint8), connectivity=8)
    left, top, right, bottom = np.round(box_px).astype(int)
    inside = np.unique(labels[max(top, 0) : bottom + 1, max(left, 0) : right + 1])
    first = np.flatnonzero(blobs.frame == 0)
    x, y = blobs.pixel_px[first].T
    return first[np.isin(labels[y, x], inside)]


def _in_box(places: Floats, box_px: Floats, margin: float) -> NDArray[np.bool_]:
    return np.asarray(((places > box_px[:2] - margin) & (places < box_px[2:] + margin)).all(axis=1))


def _opening(track: BlobTrack, maps: Sequence[NDArray[Any]]) -> int:
    """Return half the radius of the largest disc in a track's blobs, px, if thinner parts are attached, else 0."""
    radii, shares = [], []
    for m in track.members:
        hue, margin_px = maps[int(track.blobs.frame[m])], int(track.blobs.box_px[m, 2:].max())
        blob, _ = track.blobs.mask(m, hue, track.level, margin_px)
        radius = int(cv2.distanceTransform(np.pad(blob, 1), cv2.DIST_L2, 5).max() / 2.0)
        opened = cv2.morphologyEx(blob, cv2.MORPH_OPEN, disc(radius))
        radii.append(radius)
        shares.append(float(opened.sum() / blob.sum()))
    return int(np.median(radii)) if np.median(shares) < _COMPACT_SHARE else 0


def _seen_again(mark: FoundMark, cue: Cue, contrast: float, samples: Samples, hint: Floats | None) -> FoundMark | None:
    """Find the mark again by the colour that was learnt, as in the whole clip; ``None`` where it does not stay itself.

    The threshold that found the blobs may have cut off a part of the mark, or joined it to something. A disc that
    another thing passes in front of seems to move, but its area changes.
    """
    areas = SMALLEST_SHARE * mark.area_px2, np.inf
    patches = [find_patches(image, mark.model, areas, mark.opening_px) for image in samples.images]

    def region_of(i: int, patch: Patch) -> Region | None:
        region = measure(patch, mark.model)
        return None if region is None else samples.in_plane(i, region)

    # A cut patch is never the mark, and the whole wall may be one: it is measured only where a mark goes on a circle,
    # and only if it is not too large to be taken for that mark.
    inner = [[None if patch.cut else region_of(i, patch) for patch in some] for i, some in enumerate(patches)]
    blobs = blobs_of_regions([[region for region in some if region is not None] for some in inner])
    through = None
    if samples.pointed_px is not None:
        first = np.flatnonzero(blobs.frame == 0)
        through = first[_in_box(blobs.picture_px[first], samples.pointed_px, np.sqrt(mark.area_px2))]
    once = np.unique(samples.time, return_index=True)[1]  # the declared frame comes first, and may come again
    regions: list[list[Region]] = []
    best: FoundMark | None = None
    for centre in (hint,) if hint is None else (hint, None):
        track = moving_track(blobs, samples.images, 0.0, centre, on_body=cue.on_body, through=through)
        if track is None or track.circle is None:
            continue
        area, place = _typical(track)
        if area > _LARGEST_SHARE * samples.images[0].shape[0] * samples.images[0].shape[1]:
            continue
        if not regions:
            most = LARGEST_SHARE * area
            every = [
                [
                    region_of(i, patch) if patch.cut and cv2.contourArea(patch.contour_px) <= most else region
                    for patch, region in zip(*both, strict=True)
                ]
                for i, both in enumerate(zip(patches, inner, strict=True))
            ]
            regions = [[region for region in some if region is not None] for some in every]
        again = replace(mark, area_px2=area, place_px=place, circle=track.circle)
        followed = follow_mark([regions[i] for i in once], samples.time[once], again)
        share = followed.status.count(OK) / len(followed.status)
        score = contrast * track.score * share**2 * _steadiness(followed, track.circle)
        if share >= _LEAST_SHARE and (best is None or score > best.score):
            best = replace(again, score=score)
    return best


def _steadiness(followed: MarkTrack, circle: tuple[Floats, float]) -> float:
    """Return how far a mark travels relative to its scatter around the circle, from 0 for none to 1.

    A patch of wallpaper whose outline comes and goes with the noise jitters but does not travel.
    """
    places = [r.centre_px for r, s in zip(followed.regions, followed.status, strict=True) if s == OK and r is not None]
    if not places:
        return 0.0
    centre, radius = circle if followed.circle is None else (followed.circle.centre_px, followed.circle.radius_px)
    off = np.hypot(*(np.array(places) - centre).T) - radius
    travel = float(np.hypot(*np.ptp(places, axis=0)))
    return travel / (travel + _STEADY * float(np.sqrt((off**2).mean()))) if travel > 0.0 else 0.0


def _contrast_range(maps: Sequence[NDArray[Any]], at_rest: bool) -> tuple[float, float]:
    """Return the usual contrast of the picture and the highest one, of moving pixels where there are enough."""
    stack_max, stack_min = maps[0].copy(), maps[0].copy()
    for contrast in maps[1:]:
        np.maximum(stack_max, contrast, out=stack_max)
        np.minimum(stack_min, contrast, out=stack_min)
    change = np.subtract(stack_max, stack_min, out=stack_min)
    usual = float(np.median(maps[0]))
    # Moving pixels set the scale, because a static thing may have far more of the colour than the mark.
    moving = stack_max[change > MIN_CONTRAST]
    top = moving if moving.size >= _TOP_PX and not at_rest else stack_max.ravel()
    return usual, float(np.partition(top, -_TOP_PX)[-_TOP_PX])


def something_moves(images: Sequence[Image]) -> bool:
    """Return whether more pixels change than a mark covers, apart from flicker of the light."""
    greys = (cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) for image in images)
    small = np.stack([cv2.GaussianBlur(grey, (0, 0), 2.0)[::2, ::2] for grey in greys])
    median = median_picture(small)
    for picture in small:
        gain = np.median((picture + 1.0) / (median + 1.0))
        if (np.abs(picture - gain * median) > 12.0).mean() > 1e-3:
            return True
    return False
