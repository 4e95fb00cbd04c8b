"""Time-varying parameter: the damping changes while the recording runs, as that of a lubricant which warms up.

    θ̈ = c·u − a·(1 + r·T·(1 − e^(−t/T)))·θ̇ − b·θ          1 + r·t for T → ∞

r is the relative change of a in a second at first and T the time in which it settles; t is the time of the recording.
Of a, b and c the damping is taken to change, because a lubricant's viscosity falls by some per cent for each kelvin,
while the stiffness of steel falls by 0.03 % and an inertia does not change. A rest between two recordings is taken to
restore the damping: every recording starts with a. T is always fitted: without it, r would be the mean change over the
recording, which is less than the change at first.
"""

from __future__ import annotations

import numpy as np

from anglecam.effects import ports
from anglecam.effects.effect import Effect, Parameter, Values


@ports.load
def _load(time: float, theta: float, omega: float, abc: Values, parameters: Values) -> float:
    rate, settling = parameters[0], parameters[1]
    passed = time if settling == 0.0 else (1.0 - np.exp(-max(time, 0.0) * settling)) / settling
    return -abc[0] * max(rate * passed, -1.0) * omega


EFFECT = Effect(
    id="time_varying_parameter",
    station="load",
    summary="The damping changes while the recording runs, for example because the lubricant warms up.",
    equation="θ̈ = c·u − a·(1 + r·T·(1 − e^(−t/T)))·θ̇ − b·θ",
    relaxes="Eqs. (19)-(22): the lubricant's viscosity is constant",
    parameters=(
        Parameter("damping_change_per_s", "r", 0.0, -2.0, 5.0, (-0.05, 0.05)),
        Parameter("settling_time_s", "T", 0.0, 0.0, 10.0, (0.1, 0.5), inverse=True),
    ),
    aliases=("quadratic_drag", "clock_scale"),
    separating_experiment="the same steps at the start and at the end of one long recording",
    source="Stachowiak, Batchelor, Engineering Tribology, 4th ed., 2013, sec. 2.3",
    load=_load,
    in_free_swing=False,
)
