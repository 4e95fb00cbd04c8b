"""Angle drift: the measured angle drifts linearly, for example because the camera sags on its stand.

    y = θ + d·(t − t_1)

The paper's camera stands still.
"""

from __future__ import annotations

import math

from anglecam.data.camera_evidence import View
from anglecam.data.typing import Floats
from anglecam.effects.effect import Effect, Parameter


def _observe(time: Floats, angle: Floats, parameters: Floats, view: View) -> Floats:
    return angle + parameters[0] * (time - time[0])


EFFECT = Effect(
    id="angle_drift",
    station="camera",
    summary="The measured angle drifts at a steady rate that no torque explains.",
    equation="y = θ + d·t",
    relaxes="Fig. 7: the camera stands still",
    parameters=(Parameter("drift_deg_per_s", "d", 0.0, -0.1, 0.1, (0.002, -0.002), math.degrees(1.0), swing_power=1),),
    aliases=("constant_torque",),
    separating_experiment="a minute of rest, with an object in the picture that is fixed to the ground",
    source="JCGM 100:2008, F.2.4",
    observation=_observe,
)
