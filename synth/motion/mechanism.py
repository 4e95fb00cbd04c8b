"""What a plant does with nothing switched on top of it; here the base model of Eq. (30), with or without its linkage.

Whatever the plant, its motion is brought to

    inertia(θ)·θ̈ = lever(θ)·servo(v − feedback(θ)) + passive(θ, θ̇) + what effects add

where servo is `gain` times its argument unless it has a dead zone or a limit (`synth.motion.servo`), and all terms are
angular accelerations of the head.
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
    """As a share of the head's at neutral."""


class Mechanism(Protocol):
    """A plant without effects."""

    @property
    def gain(self) -> float:
        """Of the servo, rad/s² for each unit of v."""

    @property
    def reach(self) -> tuple[float, float]:
        """Lowest and highest angle for which there are terms, rad."""

    def terms(self, theta: float, omega: float, oil: float) -> Terms:
        """Terms at an angle, rad, a speed, rad/s, and a share of the viscous damping that is left."""


@dataclass(frozen=True)
class BaseModel:
    """θ̈ = c·v − a·θ̇ − b·θ, of whose b a share is the servo's position feedback and the rest a spring on the head.

    With a linkage the servo feels the crank's angle, φ(θ) in the head angle that it would mean if γ were constant, and
    by virtual work its torque reaches the head with the lever φ′(θ):

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
        """That of the linkage, if it has one."""
        return self.through.reach if self.through else (-math.inf, math.inf)

    def terms(self, theta: float, omega: float, oil: float) -> Terms:
        """See `Mechanism`."""
        phi, lever = theta, 1.0
        if self.through:
            ratio = self.through.at(theta)
            phi = -self.through.neutral_gamma * ratio.crank
            lever = self.through.neutral_gamma / ratio.gamma
        servos = self.share * self.b
        passive = (servos - self.b) * theta - self.a * oil * omega
        return Terms(servos / self.gain * phi, lever, passive, 1.0)
