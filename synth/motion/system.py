"""The right-hand side of the equation of motion, and the kinks between which it is smooth.

The state vector is θ, θ̇ and the states of the effects (`state_places`). A mode names the smooth piece in which the
state lies: the straight line of the servo, the side of each effect's edge, and the direction in which the head slides.
Nothing is smoothed; the integrator stops where a mode ends.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from synth.effects import REGISTRY, Dynamics, Effect
from synth.effects.coulomb_friction import Friction
from synth.motion.mechanism import Mechanism
from synth.motion.servo import Servo

State = list[float]
"""θ, rad, θ̇, rad/s, and the states of the effects."""
Signal = Callable[[float], float]

SLOP = 1e-12
"""A mode ends this far beyond its kink (rad, rad/s or V), so that the next mode does not end at once."""
TORQUE_SLOP = 1e-9
"""The same for the torque on a resting head, rad/s²."""


class Mode(NamedTuple):
    """A smooth piece of the right-hand side."""

    sector: int
    """Sector of the servo's error."""
    above: tuple[bool, ...]
    """For each effect with an edge: whether the head is above it."""
    sense: int
    """Direction of the sliding head, +1 or −1; 0 while it sticks."""


class Acting(NamedTuple):
    """The dynamics of one effect and its place in the system."""

    dynamics: Dynamics
    place: slice
    """Place of its states in the state vector."""
    edge: int | None
    """Index of its edge in `Mode.above`; ``None`` without an edge."""


def state_places(effects: Sequence[Effect]) -> dict[str, slice]:
    """Return the place of each effect's states in the state vector, by effect id.

    Effects with `Effect.keeps_places` come first and are always listed, whether they act or not.
    """
    kept = [effect for effect in REGISTRY if effect.keeps_places]
    places, start = {}, 2
    for effect in [*kept, *(type(effect) for effect in effects if not effect.keeps_places)]:
        places[effect.id] = slice(start, start + len(effect.states))
        start += len(effect.states)
    return places


def state_count(effects: Sequence[Effect]) -> int:
    """Return the length of the state vector."""
    return max((place.stop for place in state_places(effects).values()), default=2)


@dataclass(frozen=True)
class System:
    """A plant and all effects of actuator and load."""

    mechanism: Mechanism
    servo: Servo
    acting: tuple[Acting, ...]
    """In the order in which their torques are added."""
    friction: Friction | None
    count: int
    """Length of the state vector."""

    def rates(self, mode: Mode, drive: Signal) -> Callable[[float, State], State]:
        """Return the right-hand side within one mode, (t, state) → rates of the state."""
        friction, sense, stateful = self.friction, mode.sense, self._with("rates")

        def rates(t: float, state: State) -> State:
            omega = state[1]
            acceleration = 0.0
            if sense:
                torque, inertia, servo = self.torque(t, state, mode, drive)
                dry = friction.sliding(sense, omega, servo) if friction else 0.0
                acceleration = (torque + dry) / inertia
            out = [omega, acceleration] + [0.0] * (self.count - 2)
            for dynamics, place, _ in stateful:
                out[place] = dynamics.rates(omega, acceleration, state[place])
            return out

        return rates

    def torque(self, t: float, state: State, mode: Mode, drive: Signal) -> tuple[float, float, float]:
        """Return all torques but friction, rad/s², the inertia they act on, relative to the head's, and the servo's."""
        theta, omega = state[0], state[1]
        damping = 1.0
        for dynamics, place, _ in self._damping:
            damping *= dynamics.damping_factor(state[place])
        feedback, lever, torque, inertia = self.mechanism.terms(theta, omega, damping)
        servo = lever * self.servo.torque(mode.sector, drive(t) - feedback, omega)
        torque += servo + self.disturbance(t)
        for dynamics, place, edge in self._torques:
            torque += dynamics.torque(theta, omega, state[place], edge is not None and mode.above[edge])
        return torque, inertia, servo

    def disturbance(self, t: float) -> float:
        """Return the torques that depend on time alone, rad/s²."""
        return sum((dynamics.disturbance(t) for dynamics, _, _ in self._disturbances), 0.0)

    def mode(self, t: float, state: State, drive: Signal, sense: int = 1) -> Mode:
        """Return the mode of a state; `sense` is kept where the state does not determine it."""
        error = drive(t) - self.mechanism.terms(state[0], 0.0, 1.0).feedback
        above = tuple(dynamics.edge(state[0]) > 0 for dynamics, _, _ in self._edges)
        mode = Mode(self.servo.sector(error, state[1]), above, sense or 1)
        return self._with_sense(t, state, mode, drive) if self.reverses else mode

    @cached_property
    def reverses(self) -> bool:
        """Whether the right-hand side has a kink where the motion reverses."""
        return self.friction is not None or any(acting.dynamics.reverses for acting in self.acting)

    @cached_property
    def kinked(self) -> bool:
        """Whether a mode can end at all."""
        return bool(self.servo.kinks or self._edges or self.reverses)

    def margins(self, t: float, state: State, mode: Mode, drive: Signal) -> list[float]:
        """Return the distance to each end of the mode, negative beyond it.

        The ends are the lower and upper end of the servo's line, the edge of each effect that has one, and standstill;
        for a sticking head breaking away downwards and upwards in place of standstill.
        """
        margins = [math.inf] * (4 + len(self._edges))
        if self.servo.kinks:
            error = drive(t) - self.mechanism.terms(state[0], 0.0, 1.0).feedback
            if mode.sector > 0:
                margins[0] = error - self.servo.kink(mode.sector - 1, state[1]) + SLOP
            if mode.sector < len(self.servo.kinks):
                margins[1] = self.servo.kink(mode.sector, state[1]) - error + SLOP
        for number, (dynamics, _, _) in enumerate(self._edges):
            distance = dynamics.edge(state[0])
            margins[2 + number] = (distance if mode.above[number] else -distance) + SLOP
        if self.reverses and mode.sense:
            margins[-2] = mode.sense * state[1] + SLOP
        elif self.friction and not mode.sense:
            torque, _, servo = self.torque(t, state, mode, drive)
            margins[-2] = torque + self.friction.breakaway(-1, servo) + TORQUE_SLOP
            margins[-1] = self.friction.breakaway(+1, servo) - torque + TORQUE_SLOP
        return margins

    def beyond(self, end: int, t: float, state: State, mode: Mode, drive: Signal) -> tuple[Mode, State]:
        """Cross an end of a mode, given by its index in `margins`; return the mode beyond it and the state there."""
        if end <= 1:
            return mode._replace(sector=mode.sector + (1 if end else -1)), state
        edge = end - 2
        if edge < len(self._edges):
            flipped = (*mode.above[:edge], not mode.above[edge], *mode.above[edge + 1 :])
            return mode._replace(above=flipped), state
        if mode.sense == 0:
            return mode._replace(sense=-1 if edge == len(self._edges) else 1), state
        standing = [state[0], 0.0, *state[2:]]
        return self._with_sense(t, standing, mode._replace(sense=-mode.sense), drive), standing

    def _with_sense(self, t: float, state: State, mode: Mode, drive: Signal) -> Mode:
        """Set a mode's sense to that of the motion; at standstill, to that of the motion that begins."""
        if state[1] != 0.0:
            return mode._replace(sense=1 if state[1] > 0 else -1)
        torque, _, servo = self.torque(t, state, mode, drive)
        if self.friction:
            return mode._replace(sense=self.friction.sense(torque, servo))
        return mode if torque == 0.0 else mode._replace(sense=1 if torque > 0 else -1)

    def _with(self, method: str) -> tuple[Acting, ...]:
        """Return the effects that override a method of `Dynamics`; the others would add nothing."""
        return tuple(a for a in self.acting if getattr(type(a.dynamics), method) is not getattr(Dynamics, method))

    @cached_property
    def _torques(self) -> tuple[Acting, ...]:
        return self._with("torque")

    @cached_property
    def _damping(self) -> tuple[Acting, ...]:
        return self._with("damping_factor")

    @cached_property
    def _disturbances(self) -> tuple[Acting, ...]:
        return self._with("disturbance")

    @cached_property
    def _edges(self) -> tuple[Acting, ...]:
        return tuple(acting for acting in self.acting if acting.edge is not None)
