"""What the coarse pass over a clip finds: the mouth in every frame, and the pivot that it turns about.

Places are those in the plane of motion: what lens, tilt and a shaking stand do to the picture is undone for points,
frames stay as they were filmed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from anglecam.camera.lens import Lens
from anglecam.data.typing import Floats, Image
from anglecam.io.rig import Rig
from anglecam.video.film import Film
from anglecam.vision.image.median import median_picture
from anglecam.vision.mark.segment import Region
from anglecam.vision.pivot.circle import Circle
from anglecam.vision.pivot.estimate import PivotEstimate, combine_pivot
from anglecam.vision.pivot.marker import RoundMarker, find_marker
from anglecam.vision.rigid_body.centre_of_rotation import RigidMotion
from anglecam.vision.stabilise.background_motion import CameraMove

_SAMPLE_BYTES = 100_000_000
"""Memory for the frames of the first pass."""
_SAMPLES = 32
_STILL = 9
"""Frames whose median shows what does not move."""
_HINT_PX = 10.0
"""Standard uncertainty of a hint at the pivot."""
_SLANTED_HINT_PX = 25.0
"""The same where nothing is found so near: a mark before the plane of motion is shifted by a slanted view."""
_REACH = 2.0
"""Times its stated uncertainty that the centre of rotation may be off when a marker is looked for about it …"""
_LEAST_REACH_PX = 3.0
"""… and at least so far."""
_DEPTH = 0.15
"""Standard uncertainty of the marker's height over the mouth's, as a share of the lever arm."""


@dataclass(frozen=True)
class Detections:
    """The mouth through a clip; sequences have an entry a frame."""

    time: Floats
    """The frames' own stamps, s."""
    status: tuple[str, ...]
    regions: tuple[Region | None, ...]
    """The mouth where it was seen, in the plane of motion."""
    smeared: NDArray[np.bool_]
    """Frames that are ``occluded`` for all that is known, but may be fast motion's blur."""
    pivot: PivotEstimate
    """In the plane of motion."""
    marker: RoundMarker | None
    """The round mark at the pivot, as the picture shows it."""
    circle: Circle | None
    """Fitted to the mouth's path in the plane of motion, where it moved."""
    moves: bool
    lens: Lens
    """From the picture of a camera at rest to the plane of motion."""
    shakes: tuple[CameraMove, ...] | None
    """What the camera did in each frame; ``None`` where it stood still."""
    head: RigidMotion | None
    """The rigid head where there is no mouth; ``regions`` are empty then."""
    noise: float
    """Standard deviation of the pixels, grey levels."""
    repeated: NDArray[np.bool_]
    """Frames that are bit by bit the one before."""
    colour_rgb: tuple[int, int, int] | None
    """The mouth's colour in this clip."""
    size: tuple[int, int]
    """Width and height of the picture, px."""
    truncated: str | None
    """``truncated: 71 of 120 frames could be read`` where the file ends too early."""
    notes: tuple[str, ...]
    """What the user should know, a line each."""

    def in_picture(self, places_px: Floats) -> Floats:
        """Return where the frames, one after another, show places (frames, 2) of the plane of motion, px."""
        filmed = self.lens.distort(places_px)
        if self.shakes is None:
            return filmed
        return np.array([move.to_frame(place) for move, place in zip(self.shakes, filmed, strict=True)])


def find_pivot(
    images: Sequence[Image], rig: Rig, circle: Circle | None, lens: Lens
) -> tuple[RoundMarker | None, PivotEstimate | None, str | None]:
    """Find the pivot from its marker and from what turns about it.

    Parameters
    ----------
    images : sequence of ndarray
        (h, w, 3) frames, levelled where the camera shakes.
    rig : Rig
        What is declared about the pivot.
    circle : Circle, optional
        Whose centre is the centre of rotation, in the plane of motion.
    lens : Lens
        From the picture to the plane of motion.

    Returns
    -------
    marker : Marker or None
        As the picture shows it.
    pivot : Pivot or None
        In the plane of motion.
    note : str or None
        What to report where the two disagree.
    """
    marker = _find_marker(images, rig, circle, lens)
    return marker, *combine_pivot(*_reconciled(marker, circle, lens))


def _find_marker(images: Sequence[Image], rig: Rig, circle: Circle | None, lens: Lens) -> RoundMarker | None:
    if rig.pivot.marker == "none":
        return None
    few = images[:: max(1, len(images) // _STILL)]
    still = median_picture(np.stack(few)).astype(np.uint8)
    if rig.pivot.near is not None:
        hint = np.array(rig.pivot.near)
        near = find_marker(still, hint, _HINT_PX**2 * np.eye(2))
        return near or find_marker(still, hint, _SLANTED_HINT_PX**2 * np.eye(2))
    if circle is None:
        return find_marker(still, None, None)
    # a short arc knows well in which direction its centre lies, and badly how far off
    values, axes = np.linalg.eigh(np.nan_to_num(circle.centre_covariance_px2, nan=1e12, posinf=1e12))
    reach = np.clip(_REACH * np.sqrt(np.abs(values)), _LEAST_REACH_PX, 0.5 * float(np.hypot(*still.shape[:2])))
    return find_marker(still, lens.distort(circle.centre_px), (axes * reach**2) @ axes.T)


def _reconciled(
    marker: RoundMarker | None, circle: Circle | None, lens: Lens
) -> tuple[RoundMarker | None, Circle | None]:
    """Bring marker and centre of rotation to where they can be compared: the plane of motion.

    In a tilted view what stands at another height turns about another centre, beside the pivot's along the parallax:
    there the marker says little about the centre that the mouth turns about. And without a focal length perspective
    moves the centre of the mouth's circle, unseen (`anglecam.camera.lens`).
    """
    if marker is not None and not lens.is_identity:
        J = lens.jacobian(marker.centre_px)
        along = lens.parallax * (0.0 if circle is None else _DEPTH * circle.radius_px)
        covariance = J @ marker.covariance_px2 @ J.T + np.outer(along, along)
        marker = replace(marker, centre_px=lens.rectify(marker.centre_px), covariance_px2=covariance)
    if circle is not None and marker is not None and lens.neglects_perspective:
        circle = None
    return marker, circle


def frames_to_keep(film: Film) -> int:
    """Return how many frames the first reading keeps."""
    return int(np.clip(_SAMPLE_BYTES // max(3 * film.width * film.height, 1), 8, _SAMPLES))
