"""The whole right-hand side, and the kinks between which it is smooth.

The state is θ, θ̇, the appendage's angle ψ from the head and ψ̇, and the share w of the oil that is warm. The appendage
turns about the head's own axis, held to it by a spring and a damper; with I its inertia and J the head's,

    I·(θ̈ + ψ̈) = −k·ψ − d·ψ̇        and the head gets the opposite torque, so with s = I/J, ω² = k/I, 2ζω = d/I
    ψ̈ = −ω²·ψ − 2ζω·ψ̇ − θ̈          head: + s·(ω²·ψ + 2ζω·ψ̇)

A mode names the smooth piece in which the state is: which straight line of the servo, whether the one-sided spring is
taut, and which way the head slides. Nothing is smoothed; the integrator stops where a mode ends.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from synth.motion.friction import Friction
from synth.motion.loads import Load
from synth.motion.mechanism import Mechanism
from synth.motion.servo import Servo

State = list[float]
"""θ, θ̇, ψ, ψ̇, w."""
Signal = Callable[[float], float]

SLOP = 1e-12
"""A mode ends this much beyond its kink (rad, rad/s or V), so that the next one does not end at once."""
PULL_SLOP = 1e-9
"""The same for the pull on a resting head, rad/s²."""


class Mode(NamedTuple):
    """A smooth piece of the right-hand side."""

    sector: int
    """Of the servo's error."""
    taut: bool
    """The one-sided spring pulls."""
    sense: int
    """Of the sliding head, +1 or −1; 0 while it sticks."""


class Slack(NamedTuple):
    """A one-sided spring."""

    stiffness: float
    """1/s²."""
    angle: float
    """Above which it pulls, rad."""


class Appendage(NamedTuple):
    """What swings on the head."""

    stiffness: float
    """k/I, 1/s²."""
    damping: float
    """d/I, 1/s."""
    share: float
    """I/J."""


class Warming(NamedTuple):
    """Oil that warms by ẇ = (1 − w)·θ̇²/work and loses a share of its damping when warm."""

    share: float
    work: float
    """rad²/s."""


@dataclass(frozen=True)
class System:
    """A plant and all effects of actuator and load; what is absent is ``None``."""

    mechanism: Mechanism
    servo: Servo
    loads: tuple[Load, ...]
    shake: Signal
    """Torque from elsewhere, rad/s²."""
    slack: Slack | None
    appendage: Appendage | None
    warming: Warming | None
    friction: Friction | None
    by_sense: bool
    """Whether something changes its form where the motion turns round."""

    def rates(self, mode: Mode, drive: Signal) -> Callable[[float, State], State]:
        """Give the right-hand side within one mode, (t, state) → the state's rates."""
        appendage, warming, friction, sense = self.appendage, self.warming, self.friction, mode.sense

        def rates(t: float, state: State) -> State:
            _, omega, psi, swing, warm = state
            acceleration = 0.0
            if sense:
                pull, inertia = self.pull(t, state, mode, drive)
                dry = friction.sliding(sense, omega) if friction else 0.0
                acceleration = (pull + dry) / inertia
            swung = -appendage.stiffness * psi - appendage.damping * swing - acceleration if appendage else 0.0
            warmed = (1 - warm) * omega * omega / warming.work if warming else 0.0
            return [omega, acceleration, swing, swung, warmed]

        return rates

    def pull(self, t: float, state: State, mode: Mode, drive: Signal) -> tuple[float, float]:
        """Everything but friction, rad/s², and the inertia that it moves, as a share of the head's."""
        theta, omega, psi, swing, warm = state
        oil = 1 - self.warming.share * warm if self.warming else 1.0
        feedback, lever, pull, inertia = self.mechanism.terms(theta, omega, oil)
        pull += lever * self.servo.torque(mode.sector, drive(t) - feedback) + self.shake(t)
        for load in self.loads:
            pull += load(theta, omega)
        if self.slack and mode.taut:
            pull -= self.slack.stiffness * (theta - self.slack.angle)
        if self.appendage:
            pull += self.appendage.share * (self.appendage.stiffness * psi + self.appendage.damping * swing)
        return pull, inertia

    def mode(self, t: float, state: State, drive: Signal, sense: int = 1) -> Mode:
        """Find the mode of a state; `sense` is kept where the state does not tell."""
        error = drive(t) - self.mechanism.terms(state[0], 0.0, 1.0).feedback
        mode = Mode(self.servo.sector(error), bool(self.slack and state[0] > self.slack.angle), sense or 1)
        return self._turned(t, state, mode, drive) if self.by_sense else mode

    @property
    def kinked(self) -> bool:
        """Whether a mode can end at all."""
        return bool(self.servo.kinks or self.slack or self.by_sense)

    def margins(self, t: float, state: State, mode: Mode, drive: Signal) -> list[float]:
        """How far it is to each end of the mode; below zero beyond it.

        The ends are the lower and upper one of the servo's line, the one-sided spring's edge, and standstill; for a
        sticking head, in place of standstill, breaking away downwards and upwards.
        """
        margins = [math.inf] * 5
        if self.servo.kinks:
            error = drive(t) - self.mechanism.terms(state[0], 0.0, 1.0).feedback
            if mode.sector > 0:
                margins[0] = error - self.servo.kinks[mode.sector - 1] + SLOP
            if mode.sector < len(self.servo.kinks):
                margins[1] = self.servo.kinks[mode.sector] - error + SLOP
        if self.slack:
            above = state[0] - self.slack.angle
            margins[2] = (above if mode.taut else -above) + SLOP
        if self.by_sense and mode.sense:
            margins[3] = mode.sense * state[1] + SLOP
        elif self.friction and not mode.sense:
            pull = self.pull(t, state, mode, drive)[0]
            margins[3] = pull + self.friction.breakaway(-1) + PULL_SLOP
            margins[4] = self.friction.breakaway(+1) - pull + PULL_SLOP
        return margins

    def beyond(self, end: int, t: float, state: State, mode: Mode, drive: Signal) -> tuple[Mode, State]:
        """Cross an end of a mode, by its place among the margins: the mode beyond it, and the state there."""
        if end <= 1:
            return mode._replace(sector=mode.sector + (1 if end else -1)), state
        if end == 2:
            return mode._replace(taut=not mode.taut), state
        if mode.sense == 0:
            return mode._replace(sense=-1 if end == 3 else 1), state
        standing = [state[0], 0.0, *state[2:]]
        return self._turned(t, standing, mode._replace(sense=-mode.sense), drive), standing

    def _turned(self, t: float, state: State, mode: Mode, drive: Signal) -> Mode:
        """Give a mode the sense of its motion; at standstill, of the motion that begins."""
        if state[1] != 0.0:
            return mode._replace(sense=1 if state[1] > 0 else -1)
        pull = self.pull(t, state, mode, drive)[0]
        if self.friction:
            return mode._replace(sense=self.friction.sense(pull))
        return mode if pull == 0.0 else mode._replace(sense=1 if pull > 0 else -1)
