"""End stop: beyond an angle the body runs into a stiff spring that pushes it back and takes energy from the impact.

    θ̈ = c·u − a·θ̇ − b·θ − k·δ·(1 + χ·δ̇),   δ = θ − θ₊ > 0 above, and mirrored below θ₋

χ is Hunt and Crossley's dissipation: the damping grows with the penetration δ, so that the torque does not jump at the
contact. The stop never pulls. Stops may stand on one side or on both. In steps of 2 ms the angle is accurate to 1e-3°
for k = 8000 1/s² and to 8e-3° for 30000 1/s².
"""

from __future__ import annotations

import math

from anglecam.effects import ports
from anglecam.effects.effect import Effect, Parameter, Values
from anglecam.effects.seen import Motion, Seen

DISSIPATION = 0.3
"""s/rad, at which a fit starts. Without it the energy that an impact takes shows as a stop that is stiffer and further
out, which is another minimum of the cost."""


@ports.load
def _load(time: float, theta: float, omega: float, abc: Values, parameters: Values) -> float:
    stiffness, upper, lower, dissipation = parameters[0], parameters[1], parameters[2], parameters[3]
    if upper > 0.0 and theta * upper > 1.0:
        return -stiffness * (theta - 1.0 / upper) * max(1.0 + dissipation * omega, 0.0)
    if lower < 0.0 and theta * lower > 1.0:
        return -stiffness * (theta - 1.0 / lower) * max(1.0 - dissipation * omega, 0.0)
    return 0.0


def _starts(seen: Seen) -> list[Values]:
    """Start with stops just inside the range of the motion, on both sides, above and below.

    Both come first: a fit can move a stop out of the range, but not in from where it has no effect.
    """
    high, low = max(seen.high, 1e-3), min(seen.low, -1e-3)
    return [
        (times * seen.stiffness, above / (share * high), below / (share * low), DISSIPATION)
        for share, times in ((0.85, 4.0), (0.96, 20.0), (0.6, 2.0))
        for above, below in ((1.0, 1.0), (1.0, 0.0), (0.0, 1.0))
    ]


def _possible(parameters: Values, abc: Values, motion: Motion) -> bool:
    """Return whether a stop is reached, and stiffer than the body's springs; what yields more is no stop."""
    reached = parameters[1] * motion.high > 1.0 or parameters[2] * motion.low > 1.0
    return reached and parameters[0] > abs(abc[1])


EFFECT = Effect(
    id="end_stop",
    station="load",
    summary="The body runs into a stop at the end of its range, which pushes it back.",
    equation="θ̈ = c·u − a·θ̇ − b·θ − k·δ·(1 + χ·δ̇) with δ = θ − θ₊ > 0, and mirrored below θ₋",
    relaxes="Table 1, Fig. 4: the range of the linkage is not reached",
    parameters=(
        Parameter("stop_stiffness_per_s2", "k", 0.0, 0.0, 5e4, unlimited=True),
        Parameter("upper_stop_deg", "θ₊", 0.0, 0.0, 1e3, to_file=math.degrees(1.0), inverse=True, swing_power=1),
        Parameter("lower_stop_deg", "θ₋", 0.0, -1e3, 0.0, to_file=math.degrees(1.0), inverse=True, swing_power=1),
        Parameter("dissipation_s_per_rad", "χ", 0.0, 0.0, 10.0, swing_power=-1),
    ),
    aliases=("one_sided_spring", "stiffening_spring", "torque_saturation"),
    separating_experiment="two slow stairs, one that ends just inside the supposed stop and one that goes beyond it",
    source="Hunt, Crossley, J. Appl. Mech. 42(2), 1975; Brogliato, Nonsmooth Mechanics, 3rd ed., 2016, ch. 2",
    kinked=True,
    load=_load,
    starts=_starts,
    possible=_possible,
    in_free_swing=False,
)
