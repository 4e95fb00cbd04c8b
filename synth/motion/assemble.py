"""Builds the moving system from the spec, and finds the angle at which it rests before anything is commanded."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
from scipy.optimize import brentq

from synth.effects import Effect
from synth.effects.coulomb_friction import CoulombFriction, build_friction
from synth.effects.dead_zone import DeadZone
from synth.effects.linkage_geometry import LinkageGeometry
from synth.effects.load_dependent_friction import LoadDependentFriction
from synth.effects.speed_dependent_torque import SpeedDependentTorque
from synth.effects.torque_saturation import TorqueSaturation
from synth.motion.linkage import transmission
from synth.motion.mechanism import BaseModel, Mechanism
from synth.motion.neck import build_neck
from synth.motion.servo import build_servo
from synth.motion.system import TORQUE_SLOP, Acting, System, state_count, state_places
from synth.spec import Effects, NeckPlant, Spec

SEARCHED = math.radians(90.0)
"""Half-width of the range around neutral in which a rest angle is searched for, rad."""


def assemble(spec: Spec) -> System:
    """Put plant and effects together.

    Parameters
    ----------
    spec : Spec
        Its plant, its linkage and its effects of actuator and load are used.

    Returns
    -------
    System
        Right-hand side, modes and their ends.
    """
    effects = spec.effects
    mechanism = _mechanism(spec)
    zone, limit, dry = effects.get(DeadZone), effects.get(TorqueSaturation), effects.get(CoulombFriction)
    falling, pressed = effects.get(SpeedDependentTorque), effects.get(LoadDependentFriction)
    stall = falling.stall if falling else limit.limit if limit else None
    return System(
        mechanism=mechanism,
        servo=build_servo(
            mechanism.gain,
            math.radians(zone.half_width_deg) if zone else None,
            stall,
            math.radians(falling.no_load_deg_per_s) if falling else None,
            divided=pressed is not None,
        ),
        acting=_acting(effects.present()),
        friction=build_friction(dry, pressed.share if pressed else 0.0),
        count=state_count(effects.present()),
    )


def rest_angle(system: System) -> float:
    """Return the angle at which the head stands before the recording, uncommanded and undisturbed, rad.

    A rig has been standing for a while when its film begins, so a constant torque does not set it in motion at time 0.
    Lowered slowly from neutral, the head stops at the first angle at which friction holds the remaining torque or the
    torque vanishes. Where there is no such angle the head is released at neutral.
    """

    def no_command(t: float) -> float:
        return 0.0

    friction = system.friction

    def torques(theta: float) -> tuple[float, float]:
        state = [theta] + [0.0] * (system.count - 1)
        total, _, servo = system.torque(0.0, state, system.mode(0.0, state, no_command), no_command)
        return total - system.disturbance(0.0), servo

    first = torques(0.0)
    sense = friction.sense(*first) if friction else int(np.sign(first[0]))
    if sense == 0:
        return 0.0

    def left(theta: float) -> float:
        """Return the torque in that sense beyond what friction holds."""
        total, servo = torques(theta)
        return sense * total - (friction.breakaway(sense, servo) - TORQUE_SLOP if friction else 0.0)

    low, high = system.mechanism.reach
    angles = np.linspace(0.0, min(SEARCHED, high) if sense > 0 else max(-SEARCHED, low), 361)
    for before, after in itertools.pairwise(angles.tolist()):
        if left(after) <= 0.0:
            return float(brentq(left, before, after, xtol=1e-15, rtol=1e-14))
    return 0.0


def _acting(effects: Sequence[Effect]) -> tuple[Acting, ...]:
    places, acting, edges = state_places(effects), [], 0
    for effect in effects:
        dynamics = effect.dynamics()
        if dynamics is None:
            continue
        acting.append(Acting(dynamics, places.get(effect.id, slice(0, 0)), edges if dynamics.has_edge else None))
        edges += dynamics.has_edge
    return tuple(acting)


def _mechanism(spec: Spec) -> Mechanism:
    if isinstance(spec.plant, NeckPlant):
        return build_neck(spec.plant, spec.rig.linkage)
    geometry = spec.effects.get(LinkageGeometry)
    return BaseModel(
        a=spec.plant.a,
        b=spec.plant.b,
        gain=spec.plant.c,
        share=_servo_share(spec.effects),
        through=transmission(spec.rig.linkage) if geometry else None,
    )


def _servo_share(effects: Effects) -> float:
    """Return the share of b that is the servo's position feedback: all of it unless an effect states another."""
    stated = effects.get(TorqueSaturation) or effects.get(LinkageGeometry)
    pressed = effects.get(LoadDependentFriction)
    return stated.share if stated else 1.0 - pressed.spring_share if pressed else 1.0
