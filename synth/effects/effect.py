"""The interface of an effect: its keys in the spec, its states, and the points at which it can act on the motion.

An effect is one module of `synth.effects` with a subclass of `Effect`, named by ``EFFECT = ...`` at its end. The fields
of the subclass are the keys of the effect's section in the spec. The motion reaches the angle in this order:

    command → `Effect.follow` of every effect → lag → servo → equation of motion with `Effect.dynamics` of every effect

Effects of the camera (`camera_tilt`, `clock_scale`, …) have keys only; the camera's modules read them by their type.
"""

from __future__ import annotations

from typing import ClassVar, NamedTuple

from synth.effects.piecewise import PiecewiseLinear
from synth.section import Section


class StateVariable(NamedTuple):
    """A state that an effect adds to θ and θ̇. It starts at 0."""

    name: str
    unit: str
    is_speed: bool = False
    """Whether the state is a speed, which is 0 before the motion begins and after its end."""


class Effect(Section):
    """A section of the spec under ``effects``: present where the effect acts."""

    id: ClassVar[str]
    """The key under ``effects``."""
    order: ClassVar[int]
    """Effects act in ascending order: along the command path, in sums of torques, in ``truth.json``."""
    states: ClassVar[tuple[StateVariable, ...]] = ()
    """States that the effect adds to the equation of motion."""
    keeps_places: ClassVar[bool] = False
    """Whether the states have their places in the state vector even in motions without the effect.

    The integrator's error norm is a mean over the whole state vector, so the last digits of a motion depend on the
    vector's length. True only for the two effects that had states when the first films were rendered: those films
    stay the same bit for bit. Leave it false in a new effect.
    """
    linear_plant_only: ClassVar[bool] = False
    """Whether the neck plant models the same thing already, so that the effect is refused there."""

    def follow(self, command: PiecewiseLinear) -> PiecewiseLinear:
        """Return the command after this effect, rad."""
        return command

    def dynamics(self) -> Dynamics | None:
        """Return what the effect adds to the equation of motion; ``None`` where it adds nothing."""
        return None


class Dynamics:
    """What an effect adds to the equation of motion; override only what applies.

    `own` is the list of the effect's states, in the order of `Effect.states`.
    """

    reverses: bool = False
    """Whether the torque has a kink at θ̇ = 0, at which the integrator has to stop."""
    has_edge: bool = False
    """Whether the torque has a kink where `edge` is 0, at which the integrator has to stop."""

    def disturbance(self, t: float) -> float:
        """Return a torque that depends on time alone, rad/s²; it does not act on the head's rest before time 0."""
        return 0.0

    def torque(self, theta: float, omega: float, own: list[float], above: bool) -> float:
        """Return the torque on the head, rad/s²; `above` says on which side of `edge` the motion is."""
        return 0.0

    def damping_factor(self, own: list[float]) -> float:
        """Return the factor on the plant's viscous damping."""
        return 1.0

    def rates(self, omega: float, acceleration: float, own: list[float]) -> list[float]:
        """Return the rates of the effect's states; θ̇ in rad/s, θ̈ in rad/s²."""
        return []

    def edge(self, theta: float) -> float:
        """Return a function of the head's angle that changes sign at the torque's kink, rad."""
        return 0.0
