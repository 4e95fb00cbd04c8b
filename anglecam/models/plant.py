"""The plant θ̈ = c·u − a·θ̇ − b·θ with any effects of the ledger, as a model that an estimator can fit."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from anglecam.data.camera_evidence import UNKNOWN_VIEW, View
from anglecam.data.command import Command
from anglecam.data.typing import Floats
from anglecam.effects import Effect, Knots
from anglecam.models.integrator import INTEGRATOR, Integrator

MAX_STEP = 0.006
"""Longest Runge-Kutta step, s. At the paper's natural frequency of 23 rad/s it keeps the error of a step response
below 5e-5 degrees."""
KINKED_STEP = 0.002
"""Longest step, s, where the servo's torque has kinks, across which a step is accurate to second order only, and where
an effect adds states, which may be faster than the load."""
SHUTTER_ITERATIONS = 3
"""Fixed-point iterations for the instant at which a frame was exposed; each leaves a few hundredths of the error."""
EXACT = 0.0
"""Value of the longest step that selects the exact series, for a plant that is linear between the command's knots."""
_NO_COMMAND = Knots(np.zeros(1), np.zeros(1), np.zeros(1))


@dataclass(frozen=True)
class Plant:
    """Second-order plant, Eq. (30) of the paper, with effects."""

    effects: tuple[Effect, ...] = ()
    driven: bool = True
    """Whether any recording has a command; a free swing does not determine c."""
    integrator: Integrator = field(default=INTEGRATOR, repr=False)
    """Compiled for a ledger that contains the plant's effects."""

    states = 2
    """Unknown initial states of a recording: angle (rad) and rate (rad/s)."""

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Parameters in their order, as result files name them."""
        base = ("a_per_s", "b_per_s2", "c_per_s2") if self.driven else ("a_per_s", "b_per_s2")
        return base + tuple(p.name for e in self.effects for p in e.parameters)

    @property
    def base_count(self) -> int:
        """Number of parameters of the plant without effects; the effects' parameters follow them."""
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
        """Magnitudes, SI, that scale the steps of difference quotients."""
        return np.array([1.0, 10.0, 0.01][: self.base_count] + [0.1 for e in self.effects for _ in e.parameters])

    @property
    def to_file(self) -> Floats:
        """Factors from SI to the units in `names`."""
        return np.array([1.0] * self.base_count + [p.to_file for e in self.effects for p in e.parameters])

    @property
    def kinked(self) -> bool:
        """Whether the torque jumps or has kinks: dry friction, a servo with a limit or a dead zone, a stop."""
        return any(e.kinked or e.port in ("servo", "friction") for e in self.effects)

    def with_effect(self, effect: Effect) -> Plant:
        """Return the plant with one more effect."""
        return replace(self, effects=(*self.effects, effect))

    def predict(
        self, parameters: Floats, time: Floats, command: Command | None, state: Floats, view: View = UNKNOWN_VIEW
    ) -> Floats:
        """Return the (n,) angle, rad, that the camera would measure of the motion that `run` returns."""
        pairs = self.parameters_by_effect(parameters)
        angle, rate = self.run(parameters, time, command, state).T
        timed = [(e, p) for e, p in pairs if e.timing is not None]
        if timed:
            exposed = time
            for _ in range(SHUTTER_ITERATIONS):
                shown = angle + rate * (exposed - time)
                exposed = time
                for effect, values in timed:
                    exposed = effect.timing(exposed, shown, values, view)  # type: ignore[misc]
            angle = self._at(parameters, time, exposed, command, state)
        for effect, values in pairs:
            if effect.observation is not None:
                angle = effect.observation(time, angle, values, view)
        return angle

    def run(self, parameters: Floats, time: Floats, command: Command | None, state: Floats) -> Floats:
        """Run the plant freely from an initial state.

        Parameters
        ----------
        parameters : (p,) ndarray
            In the order of `names`, SI.
        time : (n,) ndarray
            Instants, s; the state is given at the first.
        command : Command or None
            The command; ``None`` for a free swing.
        state : (2,) ndarray
            Angle (rad) and rate (rad/s) at ``time[0]``.

        Returns
        -------
        (n, 2) ndarray
            Angle, rad, and rate, rad/s; not finite where the plant diverges.
        """
        abc = np.zeros(3)
        abc[: self.base_count] = parameters[: self.base_count]
        pairs = self.parameters_by_effect(parameters)
        knots, lag = _NO_COMMAND, 0.0
        if command is not None:
            knots = Knots(command.time, command.angle, np.zeros(len(command.time)))
        for effect, values in pairs:
            if effect.command is not None:
                knots = effect.command(knots, values)
            if effect.lag is not None:
                lag += effect.lag(values)
        rows, table = np.stack([knots.time, knots.level, knots.slope]), self.integrator.effects.table(pairs)
        return self.integrator.integrate(time, state[0], state[1], rows, lag, abc, table, self._max_step)

    @property
    def _max_step(self) -> float:
        """Longest step of the integrator, s."""
        ports = {e.port for e in self.effects}
        if ports & {"servo", "dynamics"} or any(e.kinked for e in self.effects):
            return KINKED_STEP
        return MAX_STEP if ports & {"load", "friction"} else EXACT

    def _at(self, parameters: Floats, time: Floats, exposed: Floats, command: Command | None, state: Floats) -> Floats:
        """Return the angle, rad, at instants near the frames, in any order; ``state`` is that of the first frame."""
        order = np.argsort(exposed)
        early = exposed[order] < time[0]
        grid = np.concatenate([time[:1], exposed[order][~early]])
        states = self.run(parameters, grid, command, state)
        angle = np.empty(len(time))
        angle[order[~early]] = states[1:, 0]
        # before the first frame the motion is unknown: follow its tangent
        angle[order[early]] = state[0] + state[1] * (exposed[order][early] - time[0])
        return angle

    def parameters_by_effect(self, parameters: Floats) -> list[tuple[Effect, Floats]]:
        """Pair each effect with its parameters, the fixed included, in the order in which the signal passes them."""
        edges = self.base_count + np.cumsum([0, *(len(e.parameters) for e in self.effects)])
        pairs = [(e, e.complete(parameters[i:j])) for e, i, j in zip(self.effects, edges, edges[1:], strict=False)]
        return sorted(pairs, key=lambda pair: pair[0].rank)
