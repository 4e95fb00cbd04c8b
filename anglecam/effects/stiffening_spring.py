"""Stiffening spring: the torque grows faster, or more slowly, than in proportion to the angle.

    θ̈ = c·u − a·θ̇ − b·θ − k3·θ³          k3 < 0 softens

The paper takes the spring for linear in the angle, Eqs. (18a) and (25); its Eqs. (17) and (18b) are not linear.
"""

from __future__ import annotations

from anglecam.effects import ports
from anglecam.effects.effect import Effect, Parameter, Values


@ports.load
def _load(time: float, theta: float, omega: float, abc: Values, parameters: Values) -> float:
    return -parameters[0] * theta**3


EFFECT = Effect(
    id="stiffening_spring",
    station="load",
    summary="The spring becomes stiffer, or softer, with increasing angle.",
    equation="θ̈ = c·u − a·θ̇ − b·θ − k3·θ³",
    relaxes="Eqs. (18a), (25): the spring's torque is linear in the angle",
    parameters=(Parameter("k3_per_s2", "k3", null=0.0, lower=-1e5, upper=1e5, starts=(200.0, -200.0), swing_power=-2),),
    aliases=("gravity_geometry", "linkage_geometry", "one_sided_spring", "command_curve"),
    separating_experiment="the same steps with the mount turned by 90°: gravity turns with it, the spring does not",
    source="Nayfeh, Mook, Nonlinear Oscillations, 1979, sec. 2.3",
    load=_load,
)
