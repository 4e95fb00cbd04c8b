"""Dead time: a command begins to act a fixed time later.

    θ̈ = c·u(t − τ) − a·θ̇ − b·θ

The paper's command acts at once, Eqs. (5) and (29), though its own Fig. 14 shows "an initial delay in the actual
response that was not captured". A serial link, a 50 Hz pulse frame and the servo's electronics each delay a command.
A film cannot distinguish dead time from a constant offset between the camera's clock and the command's. Without a lamp
that lights at the first command change, the parameter is the sum of both and may be negative.
"""

from __future__ import annotations

from dataclasses import replace

from anglecam.data.typing import Floats
from anglecam.effects.effect import Effect, Knots, Parameter


def _shift(given: Knots, parameters: Floats) -> Knots:
    return replace(given, time=given.time + parameters[0])


EFFECT = Effect(
    id="dead_time",
    station="command",
    summary="The body answers the command a fixed time late.",
    equation="θ̈ = c·u(t − τ) − a·θ̇ − b·θ",
    relaxes="Eqs. (5), (29): the command acts at once",
    parameters=(Parameter("tau_s", "τ", null=0.0, lower=-0.5, upper=0.5, starts=(0.01, 0.05, 0.15, -0.03)),),
    aliases=("actuator_lag", "clock_scale"),
    separating_experiment=(
        "a lamp in the picture that lights at the first command change separates delay from clock offset (without "
        "one, the parameter is the sum of both, and a negative time means that the command's time stamps are late); "
        "a chirp up to twice the natural frequency, filmed at 60 Hz or more, separates delay from lag"
    ),
    source="Ljung, System Identification, 2nd ed., 1999, sec. 4.2; the paper's Remarks on Fig. 14",
    command=_shift,
    opposite="The body moves a fixed time before its command: the command's time stamps are late against the camera's.",
)
