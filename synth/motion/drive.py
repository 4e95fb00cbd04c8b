"""The command as it reaches the load, after controller, dead time, rate limit and play, in closed form.

Controller, dead time, rate limit and play each map piecewise linear functions to piecewise linear functions, so their
composition is exact. The lag behind them, τ·v̇ = u − v, has a closed form too (`PiecewiseLinear.lagged`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from synth.effects import PiecewiseLinear
from synth.motion.controller import send
from synth.spec import Spec

Floats = NDArray[np.float64]


def drive(rows: Floats | None, spec: Spec) -> PiecewiseLinear:
    """Return the command as it reaches the load.

    Parameters
    ----------
    rows : ndarray or None
        (time_s, command_deg), each held until the next; ``None`` for no command.
    spec : Spec
        Its controller acts first, then `Effect.follow` of each effect in the effects' order.

    Returns
    -------
    PiecewiseLinear
        u(t), rad.
    """
    if rows is None:
        return PiecewiseLinear(np.zeros(1), np.zeros(1), np.zeros(1))
    knots, levels = send(rows[:, 0], np.radians(rows[:, 1]), spec.controller, spec.rig.linkage)
    command = PiecewiseLinear(knots, levels, np.zeros(len(knots)))
    for effect in spec.effects.present():
        command = effect.follow(command)
    return command
