"""Speed-dependent torque: the servo's largest torque falls with speed, as that of a motor on a fixed voltage does.

    −T·(1 + θ̇/ω0) ≤ c·u − b·θ ≤ T·(1 − θ̇/ω0)

A motor's back-EMF takes a part of the voltage that grows with speed. While the amplifier still has voltage to spare,
that loses torque in proportion to θ̇ alone: the loss is a linear damping, a part of a, and no recording separates it
from a. What is identifiable beside a, b and c is the line that limits the torque at full voltage: the stall torque T,
which is reached at rest, and the speed ω0 at which no torque is left. Against the motion the limit grows, because the
back-EMF then adds to the voltage. For ω0 → ∞ it is `torque_saturation` with a servo that has all of b, as here.
"""

from __future__ import annotations

import math

from anglecam.effects import ports
from anglecam.effects.effect import Effect, Parameter, Values
from anglecam.effects.seen import Seen


@ports.servo
def _servo(torque: float, theta: float, omega: float, abc: Values, parameters: Values) -> float:
    if parameters[0] <= 0.0:
        return torque
    stall, lost = 1.0 / parameters[0], omega * parameters[1]
    # beyond the speed without load the servo gives nothing; it does not brake
    return min(max(torque, -stall * max(1.0 + lost, 0.0)), stall * max(1.0 - lost, 0.0))


def _starts(seen: Seen) -> list[Values]:
    """Start with a stall torque that the motion reaches, and a speed without load above its fastest."""
    return [
        (1.0 / (reached * seen.torque + 1e-9), 1.0 / (beyond * seen.speed + 1e-9))
        for reached in (0.9, 0.6, 1.2)
        for beyond in (2.0, 4.0)
    ]


EFFECT = Effect(
    id="speed_dependent_torque",
    station="actuator",
    summary="The servo's largest torque falls with speed, so that it has less left when it is already moving.",
    equation="−T·(1 + θ̇/ω0) ≤ c·u − b·θ ≤ T·(1 − θ̇/ω0)",
    relaxes="Eq. (6), Fig. 12: an ideal amplifier gives any voltage at any speed",
    parameters=(
        Parameter(
            "stall_torque_deg_per_s2", "T", 0.0, 0.0, 1.0, to_file=math.degrees(1.0), inverse=True, swing_power=1
        ),
        Parameter(
            "no_load_speed_deg_per_s", "ω0", 0.0, 0.0, 5.0, to_file=math.degrees(1.0), inverse=True, swing_power=1
        ),
    ),
    aliases=("torque_saturation", "rate_limit", "quadratic_drag"),
    separating_experiment=(
        "steps of two heights from rest, and a reversal at full speed: a fixed limit gives the same torque in all"
    ),
    source="Krause, Wasynczuk, Sudhoff, Pekarek, Analysis of Electric Machinery, 3rd ed., 2013, sec. 2.3",
    rank=2,
    servo=_servo,
    starts=_starts,
    in_free_swing=False,
)
