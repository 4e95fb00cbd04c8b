"""Dead zone: the servo ignores position errors below a width.

    c·dz(u − (b/c)·θ) in place of c·u − b·θ,   dz(e) = sgn(e)·max(|e| − w, 0)

The paper's controller resolves 8 bits, Table 2, and its servo resolves every error, Eq. (5). Here all of b is
attributed to the servo's position feedback.
"""

from __future__ import annotations

import math

import numpy as np

from anglecam.effects import ports
from anglecam.effects.effect import Effect, Parameter, Values


@ports.servo
def _servo(torque: float, theta: float, omega: float, abc: Values, parameters: Values) -> float:
    if parameters[0] == 0.0:
        return torque
    width = abs(abc[2]) * parameters[0]
    return np.sign(torque) * max(abs(torque) - width, 0.0)


EFFECT = Effect(
    id="dead_zone",
    station="command",
    summary="The servo does not answer position errors below a certain size.",
    equation="θ̈ = c·dz(e) − a·θ̇ with e = u − (b/c)·θ and dz(e) = sgn e·max(|e| − w, 0)",
    relaxes="Eq. (5), Table 2: the servo resolves every command",
    parameters=(
        Parameter(
            "threshold_deg", "w", 0.0, 0.0, math.radians(15.0), (0.003, 0.01, 0.03), math.degrees(1.0), swing_power=1
        ),
    ),
    aliases=("backlash", "coulomb_friction"),
    separating_experiment="small steps around one level, from both sides: in a dead zone the body rests at any angle",
    source="Tao, Kokotović, Adaptive Control of Systems with Actuator and Sensor Nonlinearities, 1996",
    servo=_servo,
)
