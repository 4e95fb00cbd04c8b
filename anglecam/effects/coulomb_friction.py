"""Dry friction: the sleeve bearings oppose motion with a torque that does not depend on speed.

    θ̈ = c·u − a·θ̇ − b·θ − F·sgn θ̇                  while sliding, F ± D for the two directions
    θ̇ = 0      while |c·u − b·θ| ≤ max(F + B, F ± D)      the load sticks until a larger torque breaks it away
    F ± D + (B ∓ D)·exp(−(θ̇/ω_s)²)                        in place of F ± D: Stribeck's curve from break-away

F, D and B are torques divided by the moment of inertia. With ω_s = 0 friction falls to the sliding level at once. The
paper's damping is a lubricant film alone, Eqs. (19)–(22).
"""

from __future__ import annotations

import math

from anglecam.effects import ports
from anglecam.effects.effect import Effect, Parameter, Values

SI_TO_FILE = math.degrees(1.0)


@ports.friction
def _friction(torque: float, theta: float, abc: Values, parameters: Values) -> tuple[float, float, float, float]:
    mean, difference, more = parameters[0], parameters[1], parameters[2]
    breakaway = mean + more if more > 0.0 else 0.0
    return max(mean + difference, 0.0), max(mean - difference, 0.0), breakaway, parameters[3]


EFFECT = Effect(
    id="coulomb_friction",
    station="load",
    summary="Dry friction opposes motion with a torque that does not depend on speed, and holds the body near rest.",
    equation=(
        "θ̈ = c·u − a·θ̇ − b·θ − (F ± D)·sgn θ̇, F + B below speeds of about ω_s; "
        "θ̇ = 0 while |c·u − b·θ| ≤ max(F + B, F ± D)"
    ),
    relaxes="Eq. (22): damping is viscous only",
    parameters=(
        Parameter("friction_deg_per_s2", "F", 0.0, 0.0, 500.0, (0.3, 3.0, 15.0), SI_TO_FILE, swing_power=1),
        Parameter(
            "asymmetry_deg_per_s2",
            "D",
            0.0,
            -250.0,
            250.0,
            (0.0,),
            SI_TO_FILE,
            staged=True,
            mimics_zero_offset=True,
            swing_power=1,
        ),
        Parameter(
            "breakaway_excess_deg_per_s2",
            "B",
            0.0,
            0.0,
            500.0,
            (0.03, 0.1, 0.3, 0.6, 1.0, 1.7, 3.0, 5.0),
            SI_TO_FILE,
            staged=True,
            swing_power=1,
        ),
        Parameter(
            "stribeck_speed_deg_per_s",
            "ω_s",
            0.0,
            0.0,
            10.0,
            (0.01, 0.03, 0.1, 0.3, 1.0),
            SI_TO_FILE,
            staged=True,
            is_speed=True,
            swing_power=1,
        ),
    ),
    aliases=("quadratic_drag", "backlash", "dead_zone", "load_dependent_friction"),
    separating_experiment="a slow triangle of small amplitude, on which dry friction shows as a constant lag in angle",
    source="Armstrong-Hélouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994",
    friction=_friction,
)
