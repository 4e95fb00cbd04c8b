"""Pivot offset: the mark that was taken for the pivot is not where the mechanism turns.

    y = ∠(cos λ − e1, sin λ − e2) − the same at θ = 0,   λ = λ0 + θ

The angle is then that of the line from a wrong point. The paper takes the centroid of the shaft, Fig. 7. e1 and e2 are
how far ahead and up it lies of the right one, as shares of the lever arm.
"""

from __future__ import annotations

import numpy as np

from anglecam.data.camera_evidence import View
from anglecam.data.typing import Floats
from anglecam.effects.effect import Effect, Parameter


def _observe(time: Floats, angle: Floats, parameters: Floats, view: View) -> Floats:
    ahead, up = parameters

    def off(line: Floats) -> Floats:
        """Turn of the line from the wrong point against that from the right one: without a step at ±180°."""
        across, along = ahead * np.sin(line) - up * np.cos(line), ahead * np.cos(line) + up * np.sin(line)
        return np.arctan2(across, 1.0 - along)

    # neutral is known as it was seen, from the wrong point
    aside = float(np.clip(ahead * np.sin(view.neutral) - up * np.cos(view.neutral), -1.0, 1.0))
    neutral = np.asarray(view.neutral - np.arcsin(aside))
    return angle + off(neutral + angle) - off(neutral)


def _needs(view: View) -> bool:
    return view.only_pivot_differs is not False


EFFECT = Effect(
    id="pivot_offset",
    station="camera",
    summary="The angle was measured about a point beside the axis of rotation.",
    equation="y = ∠(cos λ − e1, sin λ − e2), λ = λ0 + θ",
    relaxes="Fig. 7: O is the centre of rotation",
    parameters=(
        Parameter("ahead_share_of_lever", "e1", null=0.0, lower=-0.5, upper=0.5, starts=(0.02, -0.02)),
        Parameter("up_share_of_lever", "e2", null=0.0, lower=-0.5, upper=0.5, starts=(0.02, -0.02)),
    ),
    aliases=("camera_tilt", "lens_distortion", "linkage_geometry"),
    separating_experiment="slow motion over the whole range, marker: none: the path of the mouth has its own centre",
    source="the paper, Fig. 7",
    observation=_observe,
    needs=_needs,
)
