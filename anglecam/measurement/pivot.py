"""The pivot of a clip: declared, or from a round marker in the still picture, the centre of rotation and the hint."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from anglecam.camera.lens import Lens
from anglecam.data.typing import Floats, Image
from anglecam.io.rig import Rig
from anglecam.vision.image.median import median_picture
from anglecam.vision.pivot.circle import Circle
from anglecam.vision.pivot.estimate import PivotEstimate, combine_pivot, disagreement_with_path
from anglecam.vision.pivot.marker import RoundMarker, count_round_things, find_marker

_STILL = 9
"""Frames whose median shows the still background."""
HINT_PX = 30.0
"""Standard uncertainty of each coordinate of a rough hint at the pivot, and of any in a slanted view, which shifts a
marker that lies in front of the plane of motion."""
_USUAL_HINT_PX = 10.0
"""The same of a hint as it usually is: by eye."""
_MARKER_PX = (10.0, 25.0)
"""The same by which a marker is sought about the hint: nearby first, for a screw may be farther off."""
_DECLARED_PX = 1.0
"""Standard uncertainty of a pivot that is declared without one."""
_NEARER = 0.05
"""Standard deviation of the relative difference in depth between marker and mark. A shaft that ends 50 mm before the
mark's plane, 1 m from the camera, has this."""
_REACH = 2.0
"""Radius, in standard uncertainties of the centre of rotation, within which a marker is sought."""
_LEAST_REACH_PX = 3.0
"""Lower limit of that radius."""
HEIGHT_SHARE = 0.15
"""Standard uncertainty of the marker's height above the mark's, as a share of the lever arm."""


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
        A message where they disagree with each other, or with what is declared.
    """
    if rig.pivot.at is not None:
        return None, *_declared(rig, circle, lens)
    still = _still(images)
    found = None if rig.pivot.marker == "none" else _find_marker(still, rig, circle, lens)
    marker, circle = _reconciled(found, circle, lens)
    others = 0.0
    if marker is not None and rig.pivot.marker == "auto":
        others = (count_round_things(still) + 1) / (still.shape[0] * still.shape[1])
    pivot, note = combine_pivot(marker, circle, _hint(rig, lens), others, _displacement(found, still, lens))
    if pivot is not None and pivot.elsewhere and circle is not None:
        note = "; ".join([_beside_hint(circle, rig, lens), *([note] if note else [])])
    return found, pivot, note


def _beside_hint(circle: Circle, rig: Rig, lens: Lens) -> str:
    """Return a message about a hint at another place than the centre of rotation."""
    hint = np.array(rig.pivot.near)
    x, y = lens.distort(circle.centre_px)
    off = float(np.hypot(*(circle.centre_px - lens.rectify(hint))))
    near = "{:g}, {:g}".format(*hint)
    return (
        f"what is seen to turn, turns about {x:.0f},{y:.0f}, {off:.0f} px from the hint pivot: {{near: [{near}]}}; both"
        " count; if something else is meant, point at it: mark: {at: [x, y], frame: k} in rig.yaml"
    )


def _declared(rig: Rig, circle: Circle | None, lens: Lens) -> tuple[PivotEstimate, str | None]:
    """Return the declared pivot, and a message where the mark does not move around it."""
    at = np.array(rig.pivot.at)
    J = lens.jacobian(at)
    pivot = PivotEstimate(lens.rectify(at), (rig.pivot.sigma_px or _DECLARED_PX) ** 2 * J @ J.T, "declared")
    return pivot, None if circle is None else disagreement_with_path(pivot, circle)


def _hint(rig: Rig, lens: Lens) -> PivotEstimate | None:
    if rig.pivot.near is None:
        return None
    J = lens.jacobian(np.array(rig.pivot.near))
    sigma = _USUAL_HINT_PX if lens.tilt == 0.0 else HINT_PX
    return PivotEstimate(lens.rectify(np.array(rig.pivot.near)), sigma**2 * J @ J.T, "hint")


def _displacement(marker: RoundMarker | None, still: Image, lens: Lens) -> Floats | None:
    """Return the covariance of a marker's displacement if it is at another depth than the mark.

    A point nearer to the camera is seen farther from the principal point, in proportion to that distance.
    """
    if marker is None:
        return None
    middle = (np.array(still.shape[1::-1]) - 1.0) / 2.0
    principal = middle if lens.calibration is None else lens.calibration.camera_matrix[:2, 2]
    shift = lens.jacobian(marker.centre_px) @ (_NEARER * (marker.centre_px - principal))
    return np.outer(shift, shift)


def _still(images: Sequence[Image]) -> Image:
    """Return the still background: the median of a few frames."""
    return median_picture(np.stack(images[:: max(1, len(images) // _STILL)])).astype(np.uint8)


def _find_marker(still: Image, rig: Rig, circle: Circle | None, lens: Lens) -> RoundMarker | None:
    if rig.pivot.near is not None:
        hint = np.array(rig.pivot.near)
        found = (find_marker(still, hint, sigma**2 * np.eye(2)) for sigma in _MARKER_PX)
        return next((marker for marker in found if marker is not None), None)
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
        along = lens.parallax * (0.0 if circle is None else HEIGHT_SHARE * circle.radius_px)
        covariance = J @ marker.covariance_px2 @ J.T + np.outer(along, along)
        marker = replace(marker, centre_px=lens.rectify(marker.centre_px), covariance_px2=covariance)
    if circle is not None and marker is not None and lens.neglects_perspective:
        circle = None
    return marker, circle
