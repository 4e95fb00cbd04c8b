"""What effects add to the head's own equation: angular accelerations as functions of angle and speed, all smooth."""

from __future__ import annotations

import math
from collections.abc import Callable

from synth.spec import Effects
from synth.spec.effects import ConstantTorque, GravityGeometry, PeriodicDisturbance, QuadraticDrag, StiffeningSpring

Load = Callable[[float, float], float]
"""(θ, θ̇) → rad/s²."""


def loads(effects: Effects) -> tuple[Load, ...]:
    """Collect those that are switched in."""
    builders: list[tuple[object | None, Callable]] = [
        (effects.quadratic_drag, _drag),
        (effects.stiffening_spring, _stiffening),
        (effects.gravity_geometry, _gravity),
        (effects.constant_torque, _constant),
    ]
    return tuple(build(effect) for effect, build in builders if effect is not None)


def shaking(effect: PeriodicDisturbance | None) -> Callable[[float], float]:
    """Torque from elsewhere over time, rad/s²."""
    if effect is None:
        return lambda t: 0.0
    amplitude, rate, phase = effect.amplitude, 2 * math.pi * effect.frequency_hz, effect.phase
    return lambda t: amplitude * math.sin(rate * t + phase)


def _drag(effect: QuadraticDrag) -> Load:
    q = effect.q
    return lambda theta, omega: -q * omega * abs(omega)


def _stiffening(effect: StiffeningSpring) -> Load:
    k3 = effect.k3
    return lambda theta, omega: -k3 * theta**3


def _gravity(effect: GravityGeometry) -> Load:
    strength, neutral = effect.strength, math.radians(effect.gravity_deg)
    level, slope = math.sin(neutral), math.cos(neutral)
    return lambda theta, omega: strength * (math.sin(neutral + theta) - level - theta * slope)


def _constant(effect: ConstantTorque) -> Load:
    torque = effect.torque
    return lambda theta, omega: torque
