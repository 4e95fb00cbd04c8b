"""Rolling shutter: each row of a frame has its own time, so the time of the mark depends on its height in the picture.

    recorded at t + s·(row − middle row),   row of the mark = row of the pivot − R·sin λ

The paper takes a whole frame for one instant.
"""

from __future__ import annotations

import numpy as np

from anglecam.data.camera_evidence import View
from anglecam.data.typing import Floats
from anglecam.effects.effect import Effect, Parameter


def _exposure_time(time: Floats, angle: Floats, parameters: Floats, view: View) -> Floats:
    lever, pivot = view.lever_px or 0.0, view.pivot_px or (0.0, 0.0)
    return time + parameters[0] * (pivot[1] - lever * np.sin(view.neutral + angle))


def _needs(view: View) -> bool:
    return view.lever_px is not None and view.pivot_px is not None


EFFECT = Effect(
    id="rolling_shutter",
    station="camera",
    summary="Each row of the picture is exposed later than the row above, so that a mark lower down is recorded later.",
    equation="y(t) = θ(t + s·(row − middle))",
    relaxes="a frame is one instant",
    parameters=(Parameter("row_time_s", "s", null=0.0, lower=-2e-4, upper=2e-4, starts=(1e-5, -1e-5, 6e-5)),),
    aliases=("dead_time", "quadratic_drag"),
    separating_experiment="the same motion filmed with the camera upside down",
    source="Meingast, Geyer, Sastry, OMNIVIS 2005",
    timing=_exposure_time,
    needs=_needs,
    opposite="Each row of the picture is exposed before the row above, so that a mark lower down is recorded earlier.",
)
