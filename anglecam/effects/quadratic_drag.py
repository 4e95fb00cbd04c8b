"""Quadratic drag: a resistance that grows with the square of speed, for example of air on a large, light body.

    θ̈ = c·u − a·θ̇ − b·θ − q·θ̇·|θ̇|

The paper's damping is a lubricant film alone, Eqs. (19)–(22), proportional to speed.
"""

from __future__ import annotations

from anglecam.effects import ports
from anglecam.effects.effect import Effect, Parameter, Values


@ports.load
def _load(time: float, theta: float, omega: float, abc: Values, parameters: Values) -> float:
    return -parameters[0] * omega * abs(omega)


EFFECT = Effect(
    id="quadratic_drag",
    station="load",
    summary="A resistance that grows with the square of speed slows fast motion more than slow motion.",
    equation="θ̈ = c·u − a·θ̇ − b·θ − q·θ̇·|θ̇|",
    relaxes="Eq. (22): damping is viscous only, proportional to speed",
    parameters=(Parameter("q_per_rad", "q", null=0.0, lower=0.0, upper=200.0, starts=(0.05, 1.0), swing_power=-1),),
    aliases=("coulomb_friction", "torque_saturation"),
    separating_experiment="steps or free releases of two amplitudes, one at least three times the other",
    source="Batchelor, An Introduction to Fluid Dynamics, 1967, sec. 5.11",
    load=_load,
)
