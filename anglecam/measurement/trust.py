"""Whether what was measured is the angle of something that turns about a fixed pivot.

A line can be drawn from any point to anything that moves, and it has a direction in every frame. It is the angle of a
mechanism only if the mark keeps its distance from the pivot while it moves. A cart on a rail, a pendulum on a cart, a
thrown ball, and scenery that a camera passes do not. Where the path is too short or too straight to show that, a round
thing near it is no proof of a pivot: then somebody has to declare the pivot.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from anglecam.data.series import OK
from anglecam.data.typing import Flags, Floats
from anglecam.io.rig import Rig
from anglecam.measurement.angles import Angles
from anglecam.measurement.detections import Detections
from anglecam.measurement.one_rigid_mark import FLOOR_PX, MAX_OFF_CIRCLE, PIVOT_SIGMAS, why_not_one_mark, why_not_rigid
from anglecam.measurement.what_is_seen import DECLARE_MARK, causes_seen, place_of
from anglecam.vision.pivot.circle import Circle

_MAX_SCALE_SIGMA = 0.2
"""Relative standard uncertainty of the path's radius from which on the path does not show its centre, as for a pivot
(`anglecam.vision.pivot.estimate`), and of a body's rotation from which on it is not seen."""
_DECLARE = "pivot: {at: [x, y], sigma_px: s} in rig.yaml"
_TRAVEL_PX = 0.5
"""Least RMS travel of a mark that moves, px. Noise, rain and flicker shift the centroid of a thing at rest by 0.2."""


def why_no_rotation(detections: Detections, ok: Flags, angles: Angles, rig: Rig) -> str | None:
    """Return a message where the angles are not those of a rotation about a fixed pivot.

    Parameters
    ----------
    detections : Detections
        The coarse pass.
    ok : ndarray
        (frames,) the measured frames.
    angles : Angles
        Of these frames.
    rig : Rig
        Whether the pivot is declared.

    Returns
    -------
    str or None
        With the cause, and what can be declared.
    """
    declared = rig.pivot.expected is not None
    seen_to_turn = detections.body is not None or angles.registered is not None
    lost = sum(s == "no_mouth" for s, measured in zip(detections.status, ok, strict=True) if not measured)
    if detections.moves and lost > (1.0 - rig.least_measured) * len(ok):
        return (
            f"in {lost} of {len(ok)} frames the mark is not found where a rotation about a fixed pivot would carry it;"
            f" in the others it is {place_of(detections)}; {DECLARE_MARK}"
        )
    travelled = travel(angles.mark_px)
    at_rest = not detections.moves or travelled < _TRAVEL_PX
    if at_rest and not declared:
        return f"nothing is seen to turn; to measure a mechanism at rest, declare {_DECLARE}"
    if detections.body is not None:
        return _why_not_seen_to_turn(angles)
    otherwise = None if at_rest else why_off_circle(detections, angles)
    if otherwise is None and not seen_to_turn:
        otherwise = why_not_one_mark(detections, ok, angles)
    if otherwise is not None:
        return otherwise
    if not declared and not seen_to_turn and not shows_its_centre(detections.circle):
        return (
            f"the mark's path {place_of(detections)} is too short or too straight to show about which point it turns;"
            " hint at that point: pivot: {near: [x, y]} in rig.yaml"
        )
    return None


def why_few(status: Sequence[str], least: float) -> str | None:
    """Return a message where less than a share of the frames is measured.

    Parameters
    ----------
    status : sequence of str
        Of every frame.
    least : float
        The share that the rig requires: ``least_measured``.

    Returns
    -------
    str or None
        With the counts and causes, and how to accept fewer.
    """
    measured = sum(s == OK for s in status)
    if measured >= least * len(status):
        return None
    return (
        f"only {measured} of {len(status)} frames are measured ({causes_seen(status)}), less than a share of {least:g};"
        " to accept fewer, declare least_measured: in rig.yaml"
    )


def _why_not_seen_to_turn(angles: Angles) -> str | None:
    """Return a message where a body's rotation is not seen beyond its uncertainty: its views contradict each other."""
    turned, sigma = np.degrees(float(np.std(angles.line))), np.degrees(float(np.median(angles.sigma)))
    if sigma <= _MAX_SCALE_SIGMA * turned:
        return None
    return f"the body's rotation is not seen: it is {turned:.2g}° RMS with a standard uncertainty of {sigma:.2g}°"


def why_off_circle(detections: Detections, angles: Angles) -> str | None:
    """Return a message where what moves does not keep its distance from a fixed point.

    Parameters
    ----------
    detections : Detections
        The coarse pass.
    angles : Angles
        Of the measured frames.

    Returns
    -------
    str or None
        With the variation of the distance, and the travel.
    """
    travelled = travel(angles.mark_px)
    off = _off_circle(detections, angles)
    if off <= max(MAX_OFF_CIRCLE * travelled, FLOOR_PX):
        return None
    return (
        f"what moves {place_of(detections)} does not turn about a fixed pivot: its distance from the centre varies by"
        f" {off:.2g} px RMS while it travels {travelled:.2g} px RMS; {DECLARE_MARK}"
    )


def why_doubtful(detections: Detections, ok: Flags, angles: Angles, rig: Rig, *, hand_held: bool) -> str | None:
    """Return a message where nothing shows that what turns is what is meant, and one thing.

    Parameters
    ----------
    detections : Detections
        The coarse pass.
    ok : ndarray
        (frames,) the measured frames.
    angles : Angles
        Of these frames.
    rig : Rig
        What is declared.
    hand_held : bool
        Whether the camera is held in the hand.

    Returns
    -------
    str or None
        With the cause. That the whole body turns proves what its mark alone does not.
    """
    doubt = detections.doubt or why_still(detections, ok, rig)
    if doubt is not None or angles.registered is not None:
        return doubt
    return why_not_rigid(detections, ok) or why_unproven(detections, hand_held=hand_held)


def why_still(detections: Detections, ok: Flags, rig: Rig) -> str | None:
    """Return a message where the mark that the rig declares stands still: another thing is meant, or none moves.

    Parameters
    ----------
    detections : Detections
        The coarse pass.
    ok : ndarray
        (frames,) the measured frames.
    rig : Rig
        Declares the mark by a place or by its colour.

    Returns
    -------
    str or None
        With place and travel; ``None`` where no mark is declared.
    """
    if rig.mouth == "auto" or detections.body is not None:
        return None
    places = detections.places_px[ok]
    places = places[np.isfinite(places).all(axis=1)]
    if len(places) == 0 or travel(places) >= _TRAVEL_PX:
        return None
    x, y = detections.lens.distort(np.median(places, axis=0))
    return (
        f"the declared mark stands still: around {x:.0f},{y:.0f} it travels {travel(places):.2g} px RMS; {DECLARE_MARK}"
    )


def why_unproven(detections: Detections, *, hand_held: bool) -> str | None:
    """Return a message where nothing shows that what is followed is the mark.

    Its path is too short to show about which point it turns. It was not declared, and another thing in the picture
    moves nearly as convincingly: a wire that trembles beside a servo is such a thing. Or the camera is held in the
    hand: what stands out of the plane that is held still moves before it, and so does a mark at rest.

    Parameters
    ----------
    detections : Detections
        The coarse pass.
    hand_held : bool
        Whether the camera is held in the hand.

    Returns
    -------
    str or None
        With place and travel.
    """
    if detections.body is not None or shows_its_centre(detections.circle) or (detections.clear and not hand_held):
        return None
    places = np.array([r.centre_px for r in detections.regions if r is not None])
    travelled = (
        f"what is followed, {place_of(detections)}, travels {travel(places):.2g} px RMS, too little to show that it "
        "turns about the pivot"
    )
    if detections.clear:
        return (
            f"{travelled}, and before a camera in the hand all things out of the plane that is held still seem to "
            "move; film it with a camera at rest"
        )
    return f"{travelled}, and another thing moves nearly as much: nothing shows that it is the mark; {DECLARE_MARK}"


def travel(mark_px: Floats) -> float:
    """Return the RMS distance of the mark from its mean position along the direction of most motion, px."""
    return float(np.sqrt(max(np.linalg.eigvalsh(np.cov(mark_px.T))[-1], 0.0))) if len(mark_px) > 1 else 0.0


def _off_circle(detections: Detections, angles: Angles) -> float:
    """Return the systematic variation of the distance from the centre, RMS, px.

    That is the part that neighbouring frames share: the mean product of a frame's deviation with the next one's is free
    of noise. The centre is that of the path's circle. Where the path has none, it is the pivot, whose uncertainty then
    accounts for a part.
    """
    if len(angles.mark_px) < 3:
        return 0.0
    circle = detections.circle
    centre = angles.pivot.centre_px if circle is None else circle.centre_px
    arm = angles.mark_px - centre
    lever = np.hypot(*arm.T)
    off = lever - lever.mean()
    variance = float((off[1:] * off[:-1]).mean())
    if circle is None:
        directions = np.cov((arm / np.maximum(lever, 1e-9)[:, None]).T)
        variance -= PIVOT_SIGMAS**2 * float(np.trace(angles.pivot.covariance_px2 @ directions))
    return float(np.sqrt(max(variance, 0.0)))


def shows_its_centre(circle: Circle | None) -> bool:
    """Return whether the circle of the mark's path is determined by the path alone."""
    return circle is not None and bool(circle.covariance_px2[2, 2] < (_MAX_SCALE_SIGMA * circle.radius_px) ** 2)
