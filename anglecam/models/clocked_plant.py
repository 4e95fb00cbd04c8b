"""A plant whose recordings each have a command on a clock of its own.

    u arrives in recording r at (1 + ε_r)·t + δ_r on the clip's clock

The offset δ_r and the drift ε_r change the prediction of recording r alone, as its initial state does. They are
therefore two further states of a recording, which never change, and a fit treats them as nuisance parameters.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from anglecam.data.command import Command
from anglecam.data.runs import Runs
from anglecam.data.typing import Floats
from anglecam.models.plant import Plant

OFFSET, DRIFT = 2, 3
"""Places of offset (s) and drift (a ratio) among the states of a recording; angle and rate come first."""
MOST_DRIFT = 0.5
"""Largest drift of a trial step; a clock that runs backwards has no prediction."""


@dataclass(frozen=True)
class ClockedPlant(Plant):
    """A `Plant` with the states angle (rad), rate (rad/s), offset (s) and drift of the command's clock."""

    with_drift: bool = True
    """Whether the clocks may drift; otherwise the fourth state has no effect."""

    states = 4

    def predict_all(
        self, parameters: Floats, runs: Runs, first: Floats, near: Floats | None = None
    ) -> tuple[Floats, Floats]:
        """Return angle and motion as `Plant.predict_all` does; ``first`` has four columns, one for each state.

        ``near`` does not help: it belongs to commands on other clocks.
        """
        drifts = np.clip(first[:, DRIFT], -MOST_DRIFT, MOST_DRIFT) if self.with_drift else np.zeros(len(first))
        pairs = zip(runs.commands, first[:, OFFSET], drifts, strict=True)
        clocked = replace(runs, commands=tuple(on_clock(*pair) for pair in pairs))
        return super().predict_all(parameters, clocked, first[:, :OFFSET])


def on_clock(command: Command | None, offset: float, drift: float = 0.0) -> Command | None:
    """Return a command with its times, s, on a clock that is ahead of its own by ``offset`` at zero and drifts."""
    if command is None:
        return None
    slope = None if command.slope is None else command.slope / (1.0 + drift)
    return replace(command, time=command.time * (1.0 + drift) + offset, slope=slope)
