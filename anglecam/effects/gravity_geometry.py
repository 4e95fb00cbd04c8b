"""Gravity's geometry: the moment of the weight is proportional to the sine of the angle, not to the angle.

    θ̈ = c·u − a·θ̇ − b·θ + G·(sin(θ0 + θ) − sin θ0 − θ·cos θ0),   G = M_h·g·L/J

The paper expands the sine about neutral and keeps the first term, Eq. (25). θ0 is the angle of the centre of mass from
upright at neutral. With θ0 near 0 or 180° the effect is a cubic torque, which a spring can have as well.
"""

from __future__ import annotations

import math

import numpy as np

from anglecam.effects import ports
from anglecam.effects.effect import Effect, Parameter, Values
from anglecam.effects.seen import Motion, Seen

LEFT_BY_WEIGHT = 0.05
"""Share of the weight's stiffness by which it may exceed the whole, as that of a pendulum does whose drag is not in the
model."""
ROUNDING = 0.01
"""Share by which a fit with the largest weight may miss it."""
DIRECTIONS = (0.25, 0.75, -0.75, 1.0, -0.25, 0.0)
"""Angles of the centre of mass from upright at which a fit starts, in half turns."""


@ports.load
def _load(time: float, theta: float, omega: float, abc: Values, parameters: Values) -> float:
    if parameters[0] == 0.0:
        return 0.0
    neutral = parameters[1]
    return parameters[0] * (np.sin(neutral + theta) - np.sin(neutral) - theta * np.cos(neutral))


def _starts(seen: Seen) -> list[Values]:
    """Start with a weight as strong as a part of the stiffness, in every direction."""
    return [(0.2 * seen.stiffness, math.pi * direction) for direction in DIRECTIONS]


def _largest(parameters: Values, abc: Values) -> float:
    """Return the weight that has the whole stiffness b, and servo and springs none: b is theirs less G·cos θ0."""
    downwards = -math.cos(parameters[1]) - LEFT_BY_WEIGHT
    return max(0.0, abc[1]) / downwards if downwards > 0.0 else math.inf


def _possible(parameters: Values, abc: Values, motion: Motion) -> bool:
    """Return whether servo and springs have no negative stiffness."""
    return parameters[0] <= (1.0 + ROUNDING) * _largest(parameters, abc)


EFFECT = Effect(
    id="gravity_geometry",
    station="load",
    summary="The moment of the weight follows the sine of the angle, which at large angles differs from the angle.",
    equation="θ̈ = c·u − a·θ̇ − b·θ + G·(sin(θ0 + θ) − sin θ0 − θ·cos θ0)",
    relaxes="Eq. (25): small angles about neutral",
    parameters=(
        # weight acts downwards: G < 0 at θ0 would be G > 0 at θ0 + 180°
        Parameter("gravity_deg_per_s2", "G", 0.0, 0.0, 2000.0, to_file=math.degrees(1.0)),
        Parameter(
            "gravity_deg",
            "θ0",
            0.25 * math.pi,
            -math.tau,
            math.tau,
            to_file=math.degrees(1.0),
            circular=True,
        ),
    ),
    aliases=("stiffening_spring", "linkage_geometry", "one_sided_spring"),
    separating_experiment="the same steps with the mount turned by 90°: gravity turns with it, the spring does not",
    source="the paper, Eqs. (16), (23)",
    load=_load,
    starts=_starts,
    possible=_possible,
    largest=_largest,
)
