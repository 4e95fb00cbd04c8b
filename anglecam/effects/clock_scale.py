"""Clock scale: the clip's clock runs fast or slow against the command's.

    u arrives at (1 + ε)·t on the clip's clock

The paper takes frame number over frame rate for time. A camera's nominal rate may be wrong by parts in a thousand, and
counts of frames, where some were dropped, by more. The scale of the clip's clock itself is contained in a, b and c.
"""

from __future__ import annotations

from anglecam.data.typing import Floats
from anglecam.effects.effect import Effect, Knots, Parameter


def _stretch(given: Knots, parameters: Floats) -> Knots:
    scale = 1.0 + parameters[0]
    return Knots(given.time * scale, given.level, given.slope / scale)


EFFECT = Effect(
    id="clock_scale",
    station="camera",
    summary="The camera's clock and the command's run at different rates, so that they drift apart.",
    equation="u(t/(1 + ε))",
    relaxes="the camera is said to give 15 frames a second, and that is taken as exact",
    parameters=(Parameter("scale_excess", "ε", null=0.0, lower=-0.3, upper=0.3, starts=(0.002, -0.002, 0.02, -0.02)),),
    aliases=("dead_time",),
    separating_experiment="a recording of a minute or more with a command change at its beginning and at its end",
    source="the paper, Dynamic Model Parameter Estimation: a measurement interval of 1/15 s",
    command=_stretch,
)
