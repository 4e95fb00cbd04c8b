"""Frames in which the mark is not found whole although nothing covers it: the body carries it along.

Shade, a highlight, motion blur or a second thing of its colour change the mark's outline. The body's rotation is then
measured all the same, and says where the mark is. A mark is hidden where the parts of the body around it are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from anglecam.data.typing import Flags, Floats
from anglecam.measurement.detections import Detections
from anglecam.measurement.registration_pass import Registered, Start
from anglecam.vision.image.transforms import rotate_each, rotation
from anglecam.vision.mark.segment import Region
from anglecam.vision.registration.tiles import TILE_SIDE_PX

_CARRIED_PX = 1.0
"""Largest distance of a smeared mark from the position predicted by the body's rotation, px; beyond, it is hidden."""
_CLEAR_SHARE = 0.75
"""Share of the tiles that must be visible, besides all of those around the mark."""
_MISFIT = 2.0
"""Largest misfit of the body, relative to the 95 % quantile of the frames in which the mark is found whole. It grows as
the body leaves the poses in which it was learnt."""


def smeared_marks(detections: Detections, start: Start, registered: Registered, lever_px: float) -> Flags:
    """Return the smeared frames (n,) whose mark is where the body's rotation predicts it: blurred, not hidden."""
    off = registered.turn - start.turn - start.turn_per_row * (registered.row - start.row)
    outward = np.hypot(*(detections.places_px - detections.pivot.centre_px).T) - lever_px
    along = (off - np.median(off[np.isfinite(start.sigma) & np.isfinite(off)])) * lever_px
    with np.errstate(invalid="ignore"):
        return np.asarray(detections.smeared & (np.hypot(along, outward) < _CARRIED_PX))


@dataclass(frozen=True)
class UncoveredBody:
    """How a body looks where nothing covers it."""

    misfit: float
    """Its largest misfit."""
    around: Flags
    """(tiles,) which parts of it are around the mark."""

    def is_seen(self, misfit: Floats | float, clear: Flags) -> Flags:
        """Return whether a body with this misfit and these visible parts (…, tiles) is seen, and its mark with it."""
        with np.errstate(invalid="ignore"):
            fits = np.asarray(misfit) <= self.misfit
        return np.asarray(fits & (clear.mean(axis=-1) >= _CLEAR_SHARE) & clear[..., self.around].all(axis=-1))


def uncovered_body(detections: Detections, ok: Flags, registered: Registered) -> UncoveredBody | None:
    """Return how the body looks in the frames in which its mark is found; ``None`` if no part of it is at the mark.

    Parameters
    ----------
    detections : Detections
        By the mark alone.
    ok : ndarray
        (n,) frames in which the mark is found.
    registered : Registered
        The body in every frame.
    """
    known = np.flatnonzero(ok & np.isfinite(registered.turn))
    if detections.body is not None or not len(known):
        return None
    arms = detections.places_px[known] - registered.pivot_px
    at_mark = np.median(rotate_each(arms, -registered.turn[known]), axis=0)
    moments = np.array([r.moments_px2 for i in known if (r := detections.regions[i]) is not None])
    half = 2.0 * np.sqrt(np.median(np.linalg.eigvalsh(moments)[:, -1]))  # of an ellipse's length
    middles = registered.appearance.tiles.corners + TILE_SIDE_PX / 2 - registered.appearance.pivot_px
    around = np.hypot(*(middles - at_mark).T) < half + TILE_SIDE_PX
    limit = _MISFIT * float(np.quantile(registered.misfit[known], 0.95))
    return UncoveredBody(limit, around) if around.any() else None


def carried_marks(detections: Detections, ok: Flags, registered: Registered) -> tuple[Region | None, ...]:
    """Return the mark in the frames in which it is not found and nothing covers it, ``None`` in all others.

    Parameters
    ----------
    detections : Detections
        By the mark alone.
    ok : ndarray
        (n,) frames in which the mark is found.
    registered : Registered
        The body in every frame.

    Returns
    -------
    tuple of Region or None
        An entry a frame: the mark of the frame with the nearest rotation, rotated with the body. None for a body that
        is followed without a mark.
    """
    regions: list[Region | None] = [None] * len(ok)
    uncovered = uncovered_body(detections, ok, registered)
    if uncovered is None:
        return tuple(regions)
    known = np.flatnonzero(ok & np.isfinite(registered.turn))
    carried = ~ok & np.isfinite(registered.turn) & uncovered.is_seen(registered.misfit, registered.clear)
    for i in np.flatnonzero(carried):
        near = known[np.argmin(np.abs(registered.turn[known] - registered.turn[i]))]
        like = detections.regions[near]
        if like is not None:
            regions[i] = _turned(like, float(registered.turn[i] - registered.turn[near]), registered.pivot_px)
    return tuple(regions)


def with_marks(detections: Detections, regions: Sequence[Region | None]) -> Detections:
    """Return the detections with the given marks in place of their own."""
    both = [own if region is None else region for own, region in zip(detections.regions, regions, strict=True)]
    return replace(detections, regions=tuple(both))


def _turned(region: Region, turn: float, pivot_px: Floats) -> Region:
    """Return a region rotated about the pivot."""
    M = rotation(turn)
    return replace(
        region,
        centre_px=pivot_px + (region.centre_px - pivot_px) @ M,
        moments_px2=M.T @ region.moments_px2 @ M,
        noise_px2=M.T @ region.noise_px2 @ M,
        contour_px=np.round(pivot_px + (region.contour_px - pivot_px) @ M).astype(np.int32),
    )
