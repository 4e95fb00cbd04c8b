"""Actuator lag: the torque follows the command with a first-order lag.

    τ·v̇ = u − v,   θ̈ = c·v − a·θ̇ − b·θ          third order in all

The paper neglects the motor's inductance, Eq. (30), and says that the order "could be second or third".
"""

from __future__ import annotations

from anglecam.data.typing import Floats
from anglecam.effects.effect import Effect, Parameter


def _lag(parameters: Floats) -> float:
    return float(parameters[0])


EFFECT = Effect(
    id="actuator_lag",
    station="actuator",
    summary="The torque does not jump with the command but approaches its new value over some time.",
    equation="τ·v̇ = u − v; θ̈ = c·v − a·θ̇ − b·θ",
    relaxes="Eq. (30): without inductance, second order suffices",
    parameters=(Parameter("lag_s", "τ", null=0.0, lower=0.0, upper=2.0, starts=(0.01, 0.05, 0.2)),),
    aliases=("dead_time", "rate_limit"),
    separating_experiment="a chirp up to twice the natural frequency, filmed at 60 Hz or more",
    source="Ljung, System Identification, 2nd ed., 1999, sec. 4.3; the paper's remark after Eq. (35)",
    states=1,
    lag=_lag,
)
