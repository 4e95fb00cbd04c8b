"""Command curve: the servo's angle is a bent function of the command, with slope e^(p·u + q·u²) and 0 at 0."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from synth.effects.effect import Effect
from synth.effects.piecewise import PiecewiseLinear
from synth.section import Finite


class CommandCurve(Effect):
    """A static curve of the command."""

    id: ClassVar[str] = "command_curve"
    order: ClassVar[int] = 5

    p_per_rad: Finite = 0.0
    q_per_rad2: Finite = 0.0

    def bent(self, level: float) -> float:
        """Return the servo's angle at a command, rad."""
        from scipy.integrate import quad  # SciPy takes most of a second to load

        return float(quad(lambda u: math.exp(self.p_per_rad * u + self.q_per_rad2 * u * u), 0.0, level)[0])

    def follow(self, command: PiecewiseLinear) -> PiecewiseLinear:
        """Bend the levels of a staircase; the command reaches this effect as one."""
        if np.any(command.slopes != 0.0):
            raise ValueError("command_curve: the command is not a staircase")
        return PiecewiseLinear(command.knots, np.array([self.bent(u) for u in command.levels]), command.slopes)


EFFECT = CommandCurve
