"""Perspective: a camera at a finite distance sees what turns towards it larger than what turns away.

    seen = (P + m⊥)/(1 − κ·m∥) − (P + h·n⊥)/(1 − κ·h·n∥),   y = ∠seen − the same at θ = 0

m is the unit vector from the pivot to the mark in space, n the plane's normal on which the shaft's mark stands h lever
arms before the plane, and ⊥ and ∥ are their parts in the picture and towards the camera. The plane is turned by −φ
about an axis at α. κ is the lever arm over the distance, and P the pivot from the middle of the picture in lever arms,
which the film shows. `camera_tilt` is the limit κ = 0. From a pivot in the plane (h = 0) the picture of a line is a
line at any distance, so that the angle is that of some tilt: perspective shows only by the mark before the plane, and
by little more than `camera_tilt` unless the camera is near. The lens is a pinhole whose axis meets the middle of the
picture.
"""

from __future__ import annotations

import math

import numpy as np

from anglecam.data.camera_evidence import View
from anglecam.data.typing import Floats
from anglecam.effects.effect import Effect, Parameter, Values
from anglecam.effects.seen import Seen

NEAREST = 0.2
"""Smallest depth of a point as a share of the pivot's; it keeps trial steps of a fit finite."""


def _observe(time: Floats, angle: Floats, parameters: Floats, view: View) -> Floats:
    tilt, axis, closeness, height = parameters
    lever, pivot = view.lever_px or 1.0, view.pivot_px or (0.0, 0.0)
    side = -1.0 if view.mirrored else 1.0
    # the pivot along the axis and across it, in lever arms; the frame of the picture is turned by the axis
    ahead, up = side * pivot[0] / lever, -pivot[1] / lever
    along = ahead * math.cos(axis) + up * math.sin(axis)
    across = up * math.cos(axis) - ahead * math.sin(axis)

    def nearness(towards: Floats) -> Floats:
        return 1.0 / np.maximum(1.0 - closeness * towards, NEAREST)

    shaft = nearness(np.asarray(height * math.cos(tilt)))
    from_x, from_y = along * shaft, (across + height * math.sin(tilt)) * shaft

    def off(line: Floats) -> Floats:
        """Return the turn of the seen line against the true line; it has no jump where the line turns over."""
        x, y = np.cos(line - axis), np.sin(line - axis)
        scale = nearness(-y * math.sin(tilt))
        seen_x, seen_y = (along + x) * scale - from_x, (across + y * math.cos(tilt)) * scale - from_y
        return np.arctan2(x * seen_y - y * seen_x, x * seen_x + y * seen_y)

    return angle + off(view.neutral + angle) - off(np.asarray(view.neutral))


def _starts(seen: Seen) -> list[Values]:
    """Start with the directions and mark heights of `camera_tilt`, from a near camera."""
    return [(0.3, axis, 0.25, height) for height in (0.5, -0.5) for axis in (0.0, 0.8, 1.6, 2.4)]


def _needs(view: View) -> bool:
    return view.lever_px is not None and view.pivot_px is not None and not view.only_pivot_differs


EFFECT = Effect(
    id="perspective",
    station="camera",
    summary="The camera is near and looks at a slant, so that what turns towards it appears larger.",
    equation="seen = (P + m⊥(φ, α))/(1 − κ·m∥) − (P + h·n⊥)/(1 − κ·h·n∥), y = ∠seen",
    relaxes="Fig. 7: the camera is square to the plane of motion and far away",
    parameters=(
        Parameter("yaw_deg", "φ", 0.0, 0.0, 0.9, to_file=math.degrees(1.0)),
        Parameter("yaw_axis_deg", "α", 0.0, -math.pi, math.pi, to_file=math.degrees(1.0)),
        Parameter("distance_in_levers", "κ", 0.0, 0.0, 0.8, inverse=True),
        Parameter("mark_depth_in_levers", "h", 0.0, -1.0, 1.0),
    ),
    aliases=("camera_tilt", "pivot_offset", "lens_distortion", "linkage_geometry"),
    separating_experiment="the same motion from twice the distance with twice the zoom: a tilt stays, κ halves",
    source="Hartley, Zisserman, Multiple View Geometry, 2nd ed., 2004, sec. 6.1",
    observation=_observe,
    starts=_starts,
    needs=_needs,
    in_free_swing=False,
)
