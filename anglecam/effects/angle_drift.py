"""Angle drift: the measured angle drifts linearly, for example because the camera sags on its stand.

    y = θ + d·(t − t_1)

The paper's camera stands still. A torque that grows so slowly that the body follows it turns the body by as much, and
the angles alone do not distinguish the two: only an object that is fixed to the ground does.
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
    summary="The angle drifts at a steady rate: the camera turns, or a slowly growing torque turns the body.",
    equation="y = θ + d·t",
    relaxes="Fig. 7: the camera stands still",
    parameters=(Parameter("drift_deg_per_s", "d", 0.0, -0.1, 0.1, (0.002, -0.002), math.degrees(1.0), swing_power=1),),
    aliases=("constant_torque",),
    separating_experiment="a minute of rest, with an object in the picture that is fixed to the ground",
    source="JCGM 100:2008, F.2.4",
    observation=_observe,
)
