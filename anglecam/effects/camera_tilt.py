"""Camera tilt: the camera sees the plane of motion at a slant.

    arm = (cos(λ − α), sin(λ − α)·cos φ − h·sin φ),   y = α + ∠arm − the same at θ = 0,   λ = λ0 + θ

The camera is turned by φ about an axis at α. Lengths across that axis are shortened, and a shaft mark that lies h lever
arms before the plane of motion is displaced across it against the mark on the body. The paper's camera is square to the
plane, Fig. 7. It is far away here; `perspective` is the same from a finite distance.
"""

from __future__ import annotations

import math

import numpy as np

from anglecam.data.camera_evidence import View
from anglecam.data.typing import Floats
from anglecam.effects.effect import Effect, Parameter


def _observe(time: Floats, angle: Floats, parameters: Floats, view: View) -> Floats:
    tilt, axis, height = parameters

    def off(line: Floats) -> Floats:
        """Return the turn of the seen line against the true line; it has no jump where the line turns over."""
        along, across = np.cos(line - axis), np.sin(line - axis)
        seen = across * math.cos(tilt) - height * math.sin(tilt)
        return np.arctan2(along * seen - across * along, along * along + across * seen)

    return angle + off(view.neutral + angle) - off(np.asarray(view.neutral))


def _needs(view: View) -> bool:
    return view.lever_px is not None and not view.only_pivot_differs


EFFECT = Effect(
    id="camera_tilt",
    station="camera",
    summary="The camera looks at the plane of motion at a slant, which makes some angles appear smaller than others.",
    equation="tan(y − α) = tan(λ − α)·cos φ − h·sin φ/cos(λ − α)",
    relaxes="Fig. 7: the camera is square to the plane of motion",
    parameters=(
        Parameter("tilt_deg", "φ", null=0.0, lower=0.0, upper=0.9, starts=(0.1, 0.3), to_file=math.degrees(1.0)),
        Parameter("axis_deg", "α", 0.0, -math.pi, math.pi, (0.8, 1.6, 2.4), math.degrees(1.0)),
        Parameter("mark_before_plane_in_levers", "h", 0.0, -2.0, 2.0, (0.8, -0.8)),
    ),
    aliases=("pivot_offset", "lens_distortion", "linkage_geometry", "perspective"),
    separating_experiment="a chessboard held in the plane of motion: anglecam calibrate, then camera: {calibration: …}",
    source="Hartley, Zisserman, Multiple View Geometry, 2nd ed., 2004, sec. 6.3",
    observation=_observe,
    needs=_needs,
)
