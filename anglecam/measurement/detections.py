"""The result of the coarse pass over a clip: the mark in every frame, and the pivot.

Positions are in the plane of motion: the effects of lens, tilt and a shaking camera are corrected for points. The
frames themselves are not transformed.
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
"""Memory for the frames that the first pass keeps."""
_SAMPLES = 32
"""Frames that the first pass keeps at most."""
_STILL = 9
"""Frames whose median shows the still background."""
_HINT_PX = 10.0
"""Standard uncertainty of the rig file's hint at the pivot."""
_SLANTED_HINT_PX = 25.0
"""The same where nothing is found so near: a slanted view shifts a marker that lies in front of the plane of motion."""
_REACH = 2.0
"""Radius, in standard uncertainties of the centre of rotation, within which a marker is sought."""
_LEAST_REACH_PX = 3.0
"""Lower limit of that radius."""
_DEPTH = 0.15
"""Standard uncertainty of the marker's height above the mark's, as a share of the lever arm."""


@dataclass(frozen=True)
class Detections:
    """The mark in a clip; sequences have an entry a frame."""

    time: Floats
    """Time stamps of the frames, s."""
    status: tuple[str, ...]
    regions: tuple[Region | None, ...]
    """The mark where it was found, in the plane of motion."""
    smeared: NDArray[np.bool_]
    """Frames whose status is ``occluded`` although motion blur may be the cause."""
    pivot: PivotEstimate
    """In the plane of motion."""
    marker: RoundMarker | None
    """The round marker at the pivot, in the picture."""
    circle: Circle | None
    """Fitted to the mark's path in the plane of motion; ``None`` where it does not move."""
    moves: bool
    """Whether the mark or the body moves."""
    lens: Lens
    """From the picture of a camera at rest to the plane of motion."""
    camera_moves: tuple[CameraMove, ...] | None
    """Motion of the camera in each frame; ``None`` where it stands still."""
    body: RigidMotion | None
    """Motion of the rigid body where there is no mark; ``regions`` are empty then."""
    noise: float
    """Standard deviation of the pixels, grey levels."""
    repeated: NDArray[np.bool_]
    """Frames that equal the previous frame bit for bit."""
    colour_rgb: tuple[int, int, int] | None
    """The mark's colour in this clip."""
    size: tuple[int, int]
    """Width and height of the picture, px."""
    truncated: str | None
    """``truncated: 71 of 120 frames could be read`` where the file ends too early."""
    notes: tuple[str, ...]
    """Messages to the user, a line each."""

    def in_picture(self, places_px: Floats) -> Floats:
        """Return the picture positions, px, of (frames, 2) positions in the plane of motion, one for each frame."""
        filmed = self.lens.distort(places_px)
        if self.camera_moves is None:
            return filmed
        return np.array([move.to_frame(place) for move, place in zip(self.camera_moves, filmed, strict=True)])


def find_pivot(
    images: Sequence[Image], rig: Rig, circle: Circle | None, lens: Lens
) -> tuple[RoundMarker | None, PivotEstimate | None, str | None]:
    """Estimate the pivot from its marker and from the centre of rotation.

    Parameters
    ----------
    images : sequence of ndarray
        (h, w, 3) frames, stabilised where the camera shakes.
    rig : Rig
        What is declared about the pivot.
    circle : Circle, optional
        The mark's path in the plane of motion; its centre is the centre of rotation.
    lens : Lens
        From the picture to the plane of motion.

    Returns
    -------
    marker : RoundMarker or None
        In the picture.
    pivot : PivotEstimate or None
        In the plane of motion.
    note : str or None
        A message where the two disagree.
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
    # a short arc determines the direction to its centre well, and the distance badly
    values, axes = np.linalg.eigh(np.nan_to_num(circle.centre_covariance_px2, nan=1e12, posinf=1e12))
    reach = np.clip(_REACH * np.sqrt(np.abs(values)), _LEAST_REACH_PX, 0.5 * float(np.hypot(*still.shape[:2])))
    return find_marker(still, lens.distort(circle.centre_px), (axes * reach**2) @ axes.T)


def _reconciled(
    marker: RoundMarker | None, circle: Circle | None, lens: Lens
) -> tuple[RoundMarker | None, Circle | None]:
    """Bring marker and centre of rotation into the plane of motion, in which they can be compared.

    In a tilted view, points at another height rotate about another image point, displaced from the pivot along the
    parallax. There the marker determines the mark's centre of rotation only loosely. Without a focal length,
    perspective displaces the centre of the mark's circle by an unknown amount (`anglecam.camera.lens`).
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
