"""A plant without effects; here the base model of Eq. (30), with or without its linkage.

The equation of motion of every plant is written as

    inertia(θ)·θ̈ = lever(θ)·servo(v − feedback(θ)) + passive(θ, θ̇) + effects

where servo is `gain` times its argument unless it has a dead zone or a limit (`synth.motion.servo`). All terms are
angular accelerations of the head; `synth.effects` supplies the effects' terms.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from synth.motion.linkage import Transmission


class Terms(NamedTuple):
    """The terms of the equation at one state."""

    feedback: float
    """In the unit of v."""
    lever: float
    passive: float
    """rad/s²."""
    inertia: float
    """Relative to the head's inertia at neutral."""


class Mechanism(Protocol):
    """A plant without effects."""

    @property
    def gain(self) -> float:
        """Return the servo's gain, rad/s² per unit of v."""

    @property
    def reach(self) -> tuple[float, float]:
        """Return the lowest and highest angle at which the terms are defined, rad."""

    def terms(self, theta: float, omega: float, damping: float) -> Terms:
        """Return the terms at an angle, rad, and a speed, rad/s; `damping` is a factor on the viscous damping."""


@dataclass(frozen=True)
class BaseModel:
    """θ̈ = c·v − a·θ̇ − b·θ; a share of b is the servo's position feedback, the rest a spring on the head.

    With a linkage the servo measures the crank's angle. In units of the head angle at constant γ it is φ(θ), and by
    virtual work the servo's torque acts on the head with the lever φ′(θ):

        θ̈ = φ′(θ)·(c·v − share·b·φ(θ)) − (1 − share)·b·θ − a·θ̇

    The constant is γ at neutral, where φ = θ and φ′ = 1: the base model is what remains at small angles.
    """

    a: float
    b: float
    gain: float
    """c, 1/s²."""
    share: float = 1.0
    through: Transmission | None = None

    @property
    def reach(self) -> tuple[float, float]:
        """Return the linkage's reach, unlimited without a linkage."""
        return self.through.reach if self.through else (-math.inf, math.inf)

    def terms(self, theta: float, omega: float, damping: float) -> Terms:
        """Return the terms, see `Mechanism`."""
        phi, lever = theta, 1.0
        if self.through:
            ratio = self.through.at(theta)
            phi = -self.through.neutral_gamma * ratio.crank
            lever = self.through.neutral_gamma / ratio.gamma
        servo_b = self.share * self.b
        passive = (servo_b - self.b) * theta - self.a * damping * omega
        return Terms(servo_b / self.gain * phi, lever, passive, 1.0)
