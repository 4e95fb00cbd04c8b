"""The plant θ̈ = c·u − a·θ̇ − b·θ with any effects of the ledger, as a model that an estimator can fit."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from anglecam.effects import Effect
from anglecam.session import Command
from anglecam.simulate.integrator import DRY_IDS, LOAD_IDS, WIDTH, integrate

Floats = NDArray[np.float64]

MAX_STEP = 0.004
"""s; at a natural frequency of 100 rad/s a step errs by less than 1e-4 of the amplitude."""
_NO_COMMAND = (np.zeros(1), np.zeros(1))


@dataclass(frozen=True)
class Plant:
    """Second-order plant, Eq. (30) of the paper, with effects."""

    effects: tuple[Effect, ...] = ()
    driven: bool = True
    """Whether any recording has a command; a free swing tells nothing about c."""

    states = 2
    """Unknown initial states of a recording: angle (rad) and rate (rad/s)."""

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Parameters in their order, as result files name them."""
        base = ("a_per_s", "b_per_s2", "c_per_s2") if self.driven else ("a_per_s", "b_per_s2")
        return base + tuple(p.name for e in self.effects for p in e.parameters)

    @property
    def base_count(self) -> int:
        """Parameters that are the plant's own; those of the effects follow."""
        return 3 if self.driven else 2

    @property
    def lower(self) -> Floats:
        """Lower bounds, SI; wide enough for an unstable or very fast plant."""
        base = [-100.0, -5000.0, -1e6][: self.base_count]
        return np.array(base + [p.lower for e in self.effects for p in e.parameters])

    @property
    def upper(self) -> Floats:
        """Upper bounds, SI; below the integrator's limit of stability."""
        base = [500.0, 1e5, 1e6][: self.base_count]
        return np.array(base + [p.upper for e in self.effects for p in e.parameters])

    @property
    def scales(self) -> Floats:
        """Magnitudes, SI, that difference quotients are taken against."""
        return np.array([1.0, 10.0, 10.0][: self.base_count] + [0.1 for e in self.effects for _ in e.parameters])

    @property
    def to_file(self) -> Floats:
        """Factors from SI to the units in `names`."""
        return np.array([1.0] * self.base_count + [p.to_file for e in self.effects for p in e.parameters])

    def with_effect(self, effect: Effect) -> Plant:
        """Return the plant with one more effect."""
        return Plant((*self.effects, effect), self.driven)

    def predict(self, parameters: Floats, time: Floats, command: Command | None, state: Floats) -> Floats:
        """Return the (n,) angle, rad, of `run`."""
        return self.run(parameters, time, command, state)[:, 0]

    def run(self, parameters: Floats, time: Floats, command: Command | None, state: Floats) -> Floats:
        """Run the plant freely from an initial state.

        Parameters
        ----------
        parameters : (p,) ndarray
            In the order of `names`, SI.
        time : (n,) ndarray
            Instants, s; the state is given at the first.
        command : Command or None
            What was commanded; ``None`` for a free swing.
        state : (2,) ndarray
            Angle (rad) and rate (rad/s) at ``time[0]``.

        Returns
        -------
        (n, 2) ndarray
            Angle, rad, and rate, rad/s; not finite where the plant runs away.
        """
        p = parameters
        abc = np.zeros(3)
        abc[: self.base_count] = p[: self.base_count]
        loads, dries = np.zeros((max(1, len(LOAD_IDS)), WIDTH)), np.zeros((max(1, len(DRY_IDS)), WIDTH))
        switches, values = _NO_COMMAND if command is None else (command.time, command.angle)
        at = self.base_count
        for effect in self.effects:
            own = p[at : at + len(effect.parameters)]
            at += len(effect.parameters)
            if effect.shift_command is not None:
                switches, values = effect.shift_command(switches, values, own)
            if effect.load is not None:
                loads[LOAD_IDS.index(effect.id), : len(own)] = own
            if effect.dry is not None:
                dries[DRY_IDS.index(effect.id), : len(own)] = own
        return integrate(time, state[0], state[1], switches, values, abc, loads, dries, MAX_STEP)
