"""Elastic coupling: a second mass hangs on the body by a spring and a damper, and shakes it in turn.

    θ̈ = c·u − a·θ̇ − b·θ − m·p,   ÿ = p,   p = Ω²·(θ − y) + 2·ζ·Ω·(θ̇ − ẏ),   Ω = 2π·f

y is the angle of the second mass, m its moment of inertia over the body's, f its natural frequency with the body held
and ζ its damping ratio. The servo drives the body that is measured, and the second mass is beyond it: an antenna, a
load on a slender arm, liquid. The paper's head is rigid. A mass that follows at once, for a large f, only adds to the
inertia, which a, b and c contain already.
"""

from __future__ import annotations

import math

from numba import njit

from anglecam.effects.effect import Effect, Parameter, Values


@njit
def _dynamics(
    time: float, theta: float, omega: float, v: float, abc: Values, states: Values, parameters: Values
) -> tuple[tuple[float, float], float]:
    rate = math.tau * parameters[1]
    push = rate * rate * (theta - states[0]) + 2.0 * parameters[2] * rate * (omega - states[1])
    return (states[1], push), -parameters[0] * push


@njit
def _initial(theta: float, omega: float, v: float, abc: Values, parameters: Values) -> tuple[float, float]:
    return theta, omega


EFFECT = Effect(
    id="elastic_coupling",
    station="load",
    summary="A second mass hangs on the body by a spring, swings by itself and shakes the body in turn.",
    equation="θ̈ = c·u − a·θ̇ − b·θ − m·p, ÿ = p = Ω²·(θ − y) + 2·ζ·Ω·(θ̇ − ẏ), Ω = 2π·f",
    relaxes="Eqs. (14), (16): the head is one rigid body",
    parameters=(
        Parameter("second_inertia_share", "m", 0.0, 0.0, 2.0, (0.03, 0.3)),
        Parameter("coupling_frequency_hz", "f", 3.0, 0.2, 40.0, (2.0, 3.0, 4.5, 6.5, 10.0)),
        Parameter("coupling_damping_ratio", "ζ", 0.02, 0.0, 1.0, (0.02, 0.1)),
    ),
    aliases=("periodic_disturbance", "actuator_lag", "quadratic_drag"),
    separating_experiment="a chirp through the supposed frequency, then a rest: the body goes on swinging at it",
    source="Den Hartog, Mechanical Vibrations, 4th ed., 1956, sec. 3.2",
    states=2,
    dynamics=_dynamics,
    initial=_initial,
)
