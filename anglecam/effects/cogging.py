"""Cogging: a torque that is periodic in the angle, as that of a motor's magnets past its slots, or of uneven teeth.

    θ̈ = c·u − a·θ̇ − b·θ + C·sin(n·θ + ψ)

n is the number of periods in one turn of the body. With fewer than two periods over the range in which the body usually
moves nothing repeats there, and the torque is a curve that a spring can have as well.
"""

from __future__ import annotations

import math

import numpy as np

from anglecam.data.typing import Floats
from anglecam.effects import ports
from anglecam.effects.effect import Effect, Parameter, Values
from anglecam.effects.seen import Motion, Seen, sines_and_cosines

FEWEST, MOST = 2.0, 16.0
"""Periods over the usual range of the motion between which the residual is searched."""
PER_PERIOD = 5
"""Numbers that are tried for each period more over the range."""


@ports.load
def _load(time: float, theta: float, omega: float, abc: Values, parameters: Values) -> float:
    return parameters[0] * np.sin(parameters[1] * theta + parameters[2])


def _numbers(seen: Seen) -> Floats:
    return _one_period(seen) * np.linspace(FEWEST, MOST, round(PER_PERIOD * (MOST - FEWEST)))


def _one_period(seen: Seen) -> float:
    """Return the number of periods in one turn of which one fills the usual range of the motion."""
    low, high = seen.usual
    return math.tau / max(high - low, 1e-3)


def _searched(seen: Seen) -> list[Floats]:
    return sines_and_cosines(seen.angles, _numbers(seen))


def _starts(seen: Seen) -> list[Values]:
    """Start with the waves over the angle that explain most of the residual."""
    waves = seen.waves(seen.angles, _numbers(seen), most=4)
    return [(max(w.amplitude, 1e-6), w.number, w.phase) for w in waves] or [
        (0.01 * seen.torque + 1e-6, 4 * _one_period(seen), 0.0)
    ]


def _possible(parameters: Values, abc: Values, motion: Motion) -> bool:
    """Return whether the torque repeats itself within the usual motion; one period is any curved torque."""
    low, high = motion.usual
    return parameters[1] * (high - low) >= FEWEST * math.tau


EFFECT = Effect(
    id="cogging",
    station="actuator",
    summary="The drive pulls towards evenly spaced angles, as the magnets of a motor do.",
    equation="θ̈ = c·u − a·θ̇ − b·θ + C·sin(n·θ + ψ)",
    relaxes="Eqs. (5), (6): the motor's torque does not depend on its angle",
    parameters=(
        Parameter("cogging_deg_per_s2", "C", 0.0, 0.0, 2000.0, to_file=math.degrees(1.0), swing_power=1),
        Parameter("periods_per_turn", "n", 36.0, 1.0, 3000.0),
        Parameter(
            "cogging_phase_deg", "ψ", 0.0, -2.0 * math.tau, 2.0 * math.tau, to_file=math.degrees(1.0), circular=True
        ),
    ),
    aliases=("stiffening_spring", "gravity_geometry", "linkage_geometry", "coulomb_friction"),
    separating_experiment="a slow ramp over the whole range: the angle waves about it at the same angles, up and down",
    source="Hendershot, Miller, Design of Brushless Permanent-Magnet Machines, 2010, ch. 3",
    load=_load,
    starts=_starts,
    searched=_searched,
    possible=_possible,
    in_free_swing=False,
)
