"""Damping asymmetry: the bearings resist motion in one direction more than in the other, in proportion to speed.

    θ̈ = c·u − a·θ̇ − b·θ − e·|θ̇|,   that is a + e upward and a − e downward

The paper's damping is one lubricant film, Eqs. (19)–(22), the same in both directions.
"""

from __future__ import annotations

from anglecam.effects import ports
from anglecam.effects.effect import Effect, Parameter, Values


@ports.load
def _load(time: float, theta: float, omega: float, abc: Values, parameters: Values) -> float:
    return -parameters[0] * abs(omega)


EFFECT = Effect(
    id="damping_asymmetry",
    station="load",
    summary="The bearings resist motion in one direction more than in the other, in proportion to speed.",
    equation="θ̈ = c·u − a·θ̇ − b·θ − e·|θ̇|",
    relaxes="Eq. (22): damping is the same in both directions",
    parameters=(Parameter("difference_per_s", "e", 0.0, -100.0, 100.0, (0.2, -0.2, 2.0, -2.0)),),
    aliases=("coulomb_friction", "constant_torque", "load_dependent_friction"),
    separating_experiment="the same steps up and down at two speeds, one at least three times the other",
    source="Janot, Gautier, Brunot, Data set and reference models of EMPS, Nonlinear Benchmarks Workshop, 2019",
    load=_load,
)
