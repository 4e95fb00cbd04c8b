"""Elastic coupling: a second mass hangs on the body by a spring and a damper, and shakes it in turn.

    θ̈ = c·u − a·θ̇ − b·θ − m·p,   ÿ = p,   p = Ω²·(θ − y) + 2·ζ·Ω·(θ̇ − ẏ),   Ω = 2π·f

y is the angle of the second mass, m its moment of inertia over the body's, f its natural frequency with the body held
and ζ its damping ratio. The servo drives the body that is measured, and the second mass is beyond it: an antenna, a
load on a slender arm, liquid. The paper's head is rigid. A mass that follows at once, for a large f, only adds to the
inertia, which a, b and c contain already.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from anglecam.data.typing import Floats
from anglecam.effects import ports
from anglecam.effects.effect import Effect, Out, Parameter, Values
from anglecam.effects.seen import Seen

TRIED_HZ = np.geomspace(0.6, 12.0, 150)
"""Natural frequencies that are compared with the residual, 2 % apart: a light damping needs a near one."""
DAMPINGS = (0.03, 0.2)
"""Damping ratios with which they are compared."""


@ports.dynamics
def _dynamics(
    time: float, theta: float, omega: float, v: float, abc: Values, states: Values, parameters: Values, derivatives: Out
) -> float:
    rate = math.tau * parameters[1]
    push = rate * rate * (theta - states[0]) + 2.0 * parameters[2] * rate * (omega - states[1])
    derivatives[0], derivatives[1] = states[1], push
    return -parameters[0] * push


@ports.initial
def _initial(theta: float, omega: float, v: float, abc: Values, parameters: Values, states: Out) -> None:
    states[0], states[1] = theta, omega


def _searched(seen: Seen) -> list[Floats]:
    """Return the torques of a small second mass that the model's motion moves, with either damping ratio."""
    torques = []
    for time, angle in zip(seen.times, seen.angles, strict=True):
        step, motion = float(time[1] - time[0]), np.ascontiguousarray(angle)
        each = [_push(motion, step, math.tau * TRIED_HZ, damping) for damping in DAMPINGS]
        torques.append(np.stack(each, axis=2).reshape(len(time), -1))
    return torques


def _starts(seen: Seen) -> list[Values]:
    """Start with the frequencies at which a small second mass explains most of the residual."""
    multiples, share = seen.explained(_searched(seen))
    inner = np.flatnonzero((share[1:-1] >= share[:-2]) & (share[1:-1] >= share[2:])) + 1
    found: list[Values] = []
    for i in sorted(inner, key=lambda i: -share[i])[:3]:
        # the mass is the sum of both multiples, and the larger one states the damping
        size, damping = float(np.sum(multiples[i])), DAMPINGS[int(np.argmax(np.abs(multiples[i])))]
        found.append((min(max(-size, 0.003), 0.5), float(TRIED_HZ[i]), damping))
    return found or [(0.03, float(frequency), DAMPINGS[0]) for frequency in TRIED_HZ[30::40]]


@njit("float64[:, ::1](float64[::1], float64, float64[::1], float64)", nogil=True, cache=True)
def _push(angle: Floats, step: float, rates: Floats, damping: float) -> Floats:
    """Return p, (n, k), along an evenly sampled motion, in steps that are accurate enough to start a fit."""
    push = np.zeros((len(angle), len(rates)))
    for k, rate in enumerate(rates):
        place, moving = angle[0], 0.0
        for i in range(len(angle)):
            before, after = max(i - 1, 0), min(i + 1, len(angle) - 1)
            speed = (angle[after] - angle[before]) / (step * (after - before))
            push[i, k] = rate * rate * (angle[i] - place) + 2.0 * damping * rate * (speed - moving)
            moving += step * push[i, k]
            place += step * moving
    return push


EFFECT = Effect(
    id="elastic_coupling",
    station="load",
    summary="A second mass hangs on the body by a spring, swings by itself and shakes the body in turn.",
    equation="θ̈ = c·u − a·θ̇ − b·θ − m·p, ÿ = p = Ω²·(θ − y) + 2·ζ·Ω·(θ̇ − ẏ), Ω = 2π·f",
    relaxes="Eqs. (14), (16): the head is one rigid body",
    parameters=(
        Parameter("second_inertia_share", "m", 0.0, 0.0, 2.0),
        Parameter("coupling_frequency_hz", "f", 3.0, 0.2, 40.0),
        Parameter("coupling_damping_ratio", "ζ", 0.02, 0.0, 1.0),
    ),
    aliases=("periodic_disturbance", "actuator_lag", "quadratic_drag"),
    separating_experiment="a chirp through the supposed frequency, then a rest: the body goes on swinging at it",
    source="Den Hartog, Mechanical Vibrations, 4th ed., 1956, sec. 3.2",
    states=2,
    dynamics=_dynamics,
    initial=_initial,
    starts=_starts,
    searched=_searched,
    in_free_swing=False,
)
