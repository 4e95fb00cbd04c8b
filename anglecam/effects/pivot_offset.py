"""Pivot offset: the point taken for the pivot is not the centre of rotation.

    y = ∠(cos λ − e1, sin λ − e2) − the same at θ = 0,   λ = λ0 + θ

The measured angle is then that of the line from a wrong point. The paper takes the centroid of the shaft, Fig. 7. e1
and e2 are the distances, ahead and up, of the wrong point from the centre of rotation, as shares of the lever arm.
"""

from __future__ import annotations

import numpy as np

from anglecam.data.camera_evidence import View
from anglecam.data.typing import Floats
from anglecam.effects.effect import Effect, Parameter


def _observe(time: Floats, angle: Floats, parameters: Floats, view: View) -> Floats:
    ahead, up = parameters

    def off(line: Floats) -> Floats:
        """Return the turn of the line from the wrong point against that from the centre, without a jump at ±180°."""
        across, along = ahead * np.sin(line) - up * np.cos(line), ahead * np.cos(line) + up * np.sin(line)
        return np.arctan2(across, 1.0 - along)

    # neutral is known as it was measured, from the wrong point
    aside = float(np.clip(ahead * np.sin(view.neutral) - up * np.cos(view.neutral), -1.0, 1.0))
    neutral = np.asarray(view.neutral - np.arcsin(aside))
    return angle + off(neutral + angle) - off(neutral)


def _needs(view: View) -> bool:
    return view.lever_px is not None and view.only_pivot_differs is not False


EFFECT = Effect(
    id="pivot_offset",
    station="camera",
    summary="The angle was measured about a point that is not on the axis of rotation.",
    equation="y = ∠(cos λ − e1, sin λ − e2), λ = λ0 + θ",
    relaxes="Fig. 7: O is the centre of rotation",
    parameters=(
        Parameter("ahead_share_of_lever", "e1", null=0.0, lower=-0.5, upper=0.5, starts=(0.02, -0.02)),
        Parameter("up_share_of_lever", "e2", null=0.0, lower=-0.5, upper=0.5, starts=(0.02, -0.02)),
    ),
    aliases=("camera_tilt", "lens_distortion", "linkage_geometry", "perspective"),
    separating_experiment="slow motion over the whole range, marker: none: the path of the mark has its own centre",
    source="the paper, Fig. 7",
    observation=_observe,
    needs=_needs,
)
