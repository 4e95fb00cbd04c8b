"""Torque saturation: the servo's share of the torque has a limit.

    c·u − s·b·θ stays within ±T,   s being the servo's share of b and the rest a spring on the load

The paper's amplifier is ideal, Eq. (6); Fig. 12 shows 6 V sagging to 3.5 V under load.
"""

from __future__ import annotations

import math

from anglecam.effects import ports
from anglecam.effects.effect import Effect, Parameter, Values


@ports.servo
def _servo(torque: float, theta: float, omega: float, abc: Values, parameters: Values) -> float:
    inverse, share = parameters[0], parameters[1]
    if inverse <= 0.0:
        return torque
    limit, springs = 1.0 / inverse, (1.0 - share) * abc[1] * theta
    return min(max(torque + springs, -limit), limit) - springs


EFFECT = Effect(
    id="torque_saturation",
    station="actuator",
    summary="The servo has a maximum torque: demand beyond it is not met.",
    equation="|c·u − s·b·θ| ≤ T",
    relaxes="Eq. (6), Fig. 12: an ideal amplifier gives any voltage",
    parameters=(
        Parameter(
            "limit_deg_per_s2",
            "T",
            0.0,
            0.0,
            1.0,
            (0.005, 0.01, 0.02, 0.05),
            math.degrees(1.0),
            inverse=True,
            swing_power=1,
        ),
        Parameter("servo_share", "s", 1.0, 0.0, 1.0, (0.3,)),
    ),
    aliases=("rate_limit", "quadratic_drag", "speed_dependent_torque", "end_stop"),
    separating_experiment="steps of two heights, one at least three times the other: a limit slows only the larger one",
    source="the paper, Fig. 12; HS-225MG data sheet: stall torque 0.47 N·m",
    rank=1,
    servo=_servo,
)
