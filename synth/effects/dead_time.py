"""Dead time: the command acts later."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

from synth.effects.effect import Effect
from synth.effects.piecewise import PiecewiseLinear
from synth.section import NotNegative


class DeadTime(Effect):
    """u(t) acts as u(t − τ)."""

    id: ClassVar[str] = "dead_time"
    order: ClassVar[int] = 10

    tau_s: NotNegative

    def follow(self, command: PiecewiseLinear) -> PiecewiseLinear:
        """Shift every knot by τ."""
        return replace(command, knots=command.knots + self.tau_s)


EFFECT = DeadTime
