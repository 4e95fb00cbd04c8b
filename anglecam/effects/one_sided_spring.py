"""One-sided spring: a spring that acts on one side of an angle only, as a cable that goes slack does.

    θ̈ = c·u − a·θ̇ − b·θ − |k|·(θ − θg)     only where θ > θg for k > 0, only where θ < θg for k < 0

The stiffness is b on the slack side and b + |k| on the other. The paper's two springs are stretched at every angle.
The sign states the side; a spring that goes slack above θg is one that acts below it.
"""

from __future__ import annotations

import math

from anglecam.effects import ports
from anglecam.effects.effect import Effect, Parameter, Values
from anglecam.effects.seen import Motion, Seen


@ports.load
def _load(time: float, theta: float, omega: float, abc: Values, parameters: Values) -> float:
    stiffness, stretch = parameters[0], theta - parameters[1]
    if stiffness * stretch <= 0.0:
        return 0.0
    return -abs(stiffness) * stretch


def _starts(seen: Seen) -> list[Values]:
    """Start with a part of the stiffness on either side of several angles within the range."""
    low, size = seen.low, 0.2 * seen.stiffness
    shares = (0.5, 0.25, 0.75, 0.1, 0.9)
    return [(side * size, low + share * (seen.high - low)) for share in shares for side in (1.0, -1.0)]


def _possible(parameters: Values, abc: Values, motion: Motion) -> bool:
    """Return whether the spring is slack in a part of the motion; elsewhere it is a part of b."""
    return motion.low < parameters[1] < motion.high


EFFECT = Effect(
    id="one_sided_spring",
    station="load",
    summary="A spring acts on one side of an angle only, and is slack on the other.",
    equation="θ̈ = c·u − a·θ̇ − b·θ − |k|·(θ − θg) where k·(θ − θg) > 0",
    relaxes="Eqs. (18a), (25): the springs are stretched, and linear, at every angle",
    parameters=(
        Parameter("one_sided_stiffness_per_s2", "k", 0.0, -1e5, 1e5),
        Parameter("slack_angle_deg", "θg", 0.0, -math.pi, math.pi, to_file=math.degrees(1.0), swing_power=1),
    ),
    aliases=("stiffening_spring", "gravity_geometry", "end_stop", "linkage_geometry"),
    separating_experiment="small steps well above the angle and well below it: the frequency of the swing differs",
    source="Shaw, Holmes, J. Sound Vib. 90(1), 1983",
    kinked=True,
    load=_load,
    starts=_starts,
    possible=_possible,
    in_free_swing=False,
)
