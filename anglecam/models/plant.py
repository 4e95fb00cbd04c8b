"""The plant θ̈ = c·u − a·θ̇ − b·θ with any effects of the ledger, as a model that an estimator can fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from anglecam.data.camera_evidence import UNKNOWN_VIEW, View
from anglecam.data.command import Command
from anglecam.data.runs import Runs, one_run
from anglecam.data.typing import Floats
from anglecam.effects import Effect, Knots
from anglecam.models.integrator import integrate
from anglecam.models.pieces import Pieces, pieces_of
from anglecam.models.stepping import SCRATCH_ROWS

FASTEST = 40.0
"""Natural frequency, rad/s, up to which steps and bounds hold as they stand; for a faster plant they are scaled."""
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
_NOTHING_NEAR = np.empty((0, 2))
_NO_COMMAND = np.zeros((3, 1))


@dataclass(frozen=True)
class Plant:
    """Second-order plant, Eq. (30) of the paper, with effects."""

    effects: tuple[Effect, ...] = ()
    driven: bool = True
    """Whether any recording has a command; a free swing does not determine c."""
    fastest: float = FASTEST
    """Natural frequency, rad/s, for which steps and bounds are set; at least `FASTEST`."""

    states = 2
    """Unknown initial states of a recording: angle (rad) and rate (rad/s)."""

    def __getstate__(self) -> dict[str, Any]:
        """Return what is pickled: all but the addresses of compiled functions, which hold in this process only."""
        return {name: value for name, value in self.__dict__.items() if name != "pieces"}

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
        base = self._scaled([-100.0, -5000.0, -1e6])
        return np.array(base + [p.lower for e in self.effects for p in e.parameters])

    @property
    def upper(self) -> Floats:
        """Upper bounds, SI; below the integrator's limit of stability."""
        base = self._scaled([500.0, 1e5, 1e6])
        return np.array(base + [p.upper for e in self.effects for p in e.parameters])

    def _scaled(self, bounds: Sequence[float]) -> list[float]:
        """Return bounds of a, b, c for the natural frequency `fastest`."""
        rate = self.fastest / FASTEST
        return [bound * rate**power for bound, power in zip(bounds, (1, 2, 2), strict=True)][: self.base_count]

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
        return self.predict_all(parameters, one_run(time, command, view), state[None])[0]

    def predict_all(
        self, parameters: Floats, runs: Runs, first: Floats, near: Floats | None = None
    ) -> tuple[Floats, Floats]:
        """Return the angle that the camera would measure in several runs, and their motion.

        Parameters
        ----------
        parameters : (p,) ndarray
            In the order of `names`, SI.
        runs : Runs
            N instants of R runs, with their commands and views.
        first : (R, 2) ndarray
            Angle (rad) and rate (rad/s) at the first instant of each run.
        near : (N, 2) ndarray, optional
            Motion with the same parameters from a slightly different ``first``. A run that reaches the same state is
            not integrated further.

        Returns
        -------
        angle : (N,) ndarray
            rad.
        motion : (N, 2) ndarray
            As `run` returns it.
        """
        pairs = self.parameters_by_effect(parameters)
        motion = self._run(parameters, pairs, runs, first, near)
        angle, rate = motion.T
        timed = [(e, p) for e, p in pairs if e.timing is not None]
        if timed:
            exposed = runs.time
            for _ in range(SHUTTER_ITERATIONS):
                shown = angle + rate * (exposed - runs.time)
                exposed = runs.time
                for effect, values in timed:
                    exposed = runs.each(effect.timing, exposed, shown, values)  # type: ignore[arg-type]
            angle = self._at(parameters, pairs, runs, exposed, first)
        for effect, values in pairs:
            if effect.observation is not None:
                angle = runs.each(effect.observation, runs.time, angle, values)
        return angle, motion

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
        runs = one_run(time, command, UNKNOWN_VIEW)
        return self._run(parameters, self.parameters_by_effect(parameters), runs, state[None])

    def _run(
        self,
        parameters: Floats,
        pairs: Sequence[tuple[Effect, Floats]],
        runs: Runs,
        first: Floats,
        near: Floats | None = None,
    ) -> Floats:
        """Run the plant freely through several runs; (N, 2)."""
        abc = np.zeros(3)
        abc[: self.base_count] = parameters[: self.base_count]
        lag = float(sum(effect.lag(values) for effect, values in pairs if effect.lag is not None))
        given, number = runs.played
        arrived = [_arrived(command, pairs) for command in given]
        edges = np.cumsum([0, *(each.shape[1] for each in arrived)])
        return integrate(
            runs.time,
            runs.edges,
            np.ascontiguousarray(first, dtype=float),
            arrived[0] if len(arrived) == 1 else np.concatenate(arrived, axis=1),
            np.stack([edges[number], edges[number + 1]], axis=1),
            lag,
            abc,
            self.pieces.table,
            self.pieces.edges,
            self._numbers(parameters, pairs, runs),
            np.empty((1 + SCRATCH_ROWS, self.pieces.states)),
            self._max_step,
            _NOTHING_NEAR if near is None else near,
        )

    @cached_property
    def pieces(self) -> Pieces:
        """What is inside the equation of motion, compiled."""
        return pieces_of(self.effects)

    def _numbers(self, parameters: Floats, pairs: Sequence[tuple[Effect, Floats]], runs: Runs) -> Floats:
        """Return the parameters of `pieces`."""
        return self.pieces.numbers(pairs)

    @property
    def smooth_step(self) -> float:
        """Longest step of the integrator where no torque has a kink, s."""
        return MAX_STEP * FASTEST / self.fastest

    @property
    def _max_step(self) -> float:
        """Longest step of the integrator, s."""
        ports = {e.port for e in self.effects}
        if ports & {"servo", "dynamics"} or any(e.kinked for e in self.effects):
            return KINKED_STEP * FASTEST / self.fastest
        return self.smooth_step if ports & {"load", "friction"} else EXACT

    def _at(
        self, parameters: Floats, pairs: Sequence[tuple[Effect, Floats]], runs: Runs, exposed: Floats, first: Floats
    ) -> Floats:
        """Return the (N,) angle, rad, at instants near the frames, in any order within each run."""
        late = exposed >= runs.first[runs.owner]
        count, owner = len(first), runs.owner[late]
        numbers, instants = np.append(np.arange(count), owner), np.append(runs.first, exposed[late])
        order = np.lexsort((instants, numbers))
        edges = np.searchsorted(numbers[order], np.arange(count + 1))
        grid = Runs(instants[order], edges, runs.commands, runs.views)
        reached = np.empty(len(order))
        reached[order] = self._run(parameters, pairs, grid, first)[:, 0]
        # before the first frame the motion is unknown: follow its tangent
        angle = first[runs.owner, 0] + first[runs.owner, 1] * (exposed - runs.first[runs.owner])
        angle[late] = reached[count:]
        return angle

    def parameters_by_effect(self, parameters: Floats) -> list[tuple[Effect, Floats]]:
        """Pair each effect with its parameters, the fixed included, in the order in which the signal passes them."""
        edges = self.base_count + np.cumsum([0, *(len(e.parameters) for e in self.effects)])
        pairs = [(e, e.complete(parameters[i:j])) for e, i, j in zip(self.effects, edges, edges[1:], strict=False)]
        return sorted(pairs, key=lambda pair: pair[0].rank)


def _arrived(command: Command | None, pairs: Sequence[tuple[Effect, Floats]]) -> Floats:
    """Return the knots (3, m) of the command that arrives at the drive: instants, levels and slopes."""
    given = _NO_COMMAND if command is None else command.knots
    shaping = [(effect.command, values) for effect, values in pairs if effect.command is not None]
    if not shaping:
        return given
    knots = Knots(*given)
    for shape, values in shaping:
        knots = shape(knots, values)
    return np.stack([knots.time, knots.level, knots.slope])
