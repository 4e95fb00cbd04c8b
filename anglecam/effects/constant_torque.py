"""Constant torque: the spring does not balance the weight exactly.

    θ̈ = c·u − a·θ̇ − b·θ + T

The paper's spring balances gravity exactly at neutral, Eqs. (23) and (24), though its steady states were "off by about
4°". If b > 0, a wrong zero of the angle has the same effect, and the zero is a nuisance parameter of every recording
unless neutral is declared. The torque can be determined only if neutral is declared or there is no stiffness.
"""

from __future__ import annotations

import math

from anglecam.effects import ports
from anglecam.effects.effect import Effect, Parameter, Values


@ports.load
def _load(time: float, theta: float, omega: float, abc: Values, parameters: Values) -> float:
    return parameters[0]


EFFECT = Effect(
    id="constant_torque",
    station="load",
    summary="A constant torque holds the body away from the angle at which it should rest.",
    equation="θ̈ = c·u − a·θ̇ − b·θ + T",
    relaxes="Eqs. (23), (24): the spring balances gravity exactly at neutral",
    parameters=(
        Parameter(
            "torque_deg_per_s2",
            "T",
            0.0,
            -500.0,
            500.0,
            (1.0, -1.0, 20.0, -20.0),
            math.degrees(1.0),
            mimics_zero_offset=True,
            swing_power=1,
        ),
    ),
    aliases=("coulomb_friction",),
    separating_experiment="a rest without power, where only spring and weight hold the body",
    source="the paper, Remarks on Fig. 14",
    load=_load,
)
