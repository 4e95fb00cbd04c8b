"""From the spec to the system that moves, and where that stands before anything is commanded."""

from __future__ import annotations

import itertools
import math

import numpy as np
from scipy.optimize import brentq

from synth.motion.friction import build_friction
from synth.motion.linkage import transmission
from synth.motion.loads import loads, shaking
from synth.motion.mechanism import BaseModel, Mechanism
from synth.motion.neck import build_neck
from synth.motion.servo import build_servo
from synth.motion.system import PULL_SLOP, Appendage, Slack, System, Warming
from synth.spec import Effects, NeckPlant, Spec

SEARCHED = math.radians(90.0)
"""How far from neutral a place to rest is looked for, rad."""


def assemble(spec: Spec) -> System:
    """Put plant and effects together.

    Parameters
    ----------
    spec : Spec
        Of which plant, linkage and the effects of actuator and load act here.

    Returns
    -------
    System
        Right-hand side, modes and their ends.
    """
    effects = spec.effects
    mechanism = _mechanism(spec)
    zone, limit, swung = effects.dead_zone, effects.torque_saturation, effects.flexible_appendage
    rate = 2 * math.pi * swung.frequency_hz if swung else 0.0
    slack, warming, dry = effects.slack_spring, effects.warming_damping, effects.coulomb_friction
    return System(
        mechanism=mechanism,
        servo=build_servo(
            mechanism.gain,
            math.radians(zone.half_width_deg) if zone else None,
            limit.limit if limit else None,
        ),
        loads=loads(effects),
        shake=shaking(effects.periodic_disturbance),
        slack=Slack(slack.stiffness, math.radians(slack.slack_deg)) if slack else None,
        appendage=Appendage(rate**2, 2 * swung.damping_ratio * rate, swung.inertia_share) if swung else None,
        warming=Warming(warming.share, warming.work) if warming else None,
        friction=build_friction(dry) if dry else None,
        by_sense=dry is not None or effects.quadratic_drag is not None,
    )


def rest_angle(system: System) -> float:
    """Where the head stands before the recording, uncommanded and unshaken, rad.

    A rig has been standing for a while when its film begins, so a steady torque does not set it in motion at time 0.
    Let down from neutral without haste it stops at the first angle at which friction holds what pulls it or nothing
    pulls it any more; where there is none it is let go at neutral.
    """

    def still(t: float) -> float:
        return 0.0

    def pull(theta: float) -> float:
        state = [theta, 0.0, 0.0, 0.0, 0.0]
        return system.pull(0.0, state, system.mode(0.0, state, still), still)[0] - system.shake(0.0)

    first, friction = pull(0.0), system.friction
    sense = friction.sense(first) if friction else int(np.sign(first))
    if sense == 0:
        return 0.0
    held = friction.breakaway(sense) - PULL_SLOP if friction else 0.0
    low, high = system.mechanism.reach
    angles = np.linspace(0.0, min(SEARCHED, high) if sense > 0 else max(-SEARCHED, low), 361)
    for before, after in itertools.pairwise(angles.tolist()):
        if sense * pull(after) <= held:
            return float(brentq(lambda theta: sense * pull(theta) - held, before, after, xtol=1e-15, rtol=1e-14))
    return 0.0


def _mechanism(spec: Spec) -> Mechanism:
    if isinstance(spec.plant, NeckPlant):
        return build_neck(spec.plant, spec.rig.linkage)
    geometry = spec.effects.linkage_geometry
    return BaseModel(
        a=spec.plant.a,
        b=spec.plant.b,
        gain=spec.plant.c,
        share=_servo_share(spec.effects),
        through=transmission(spec.rig.linkage) if geometry else None,
    )


def _servo_share(effects: Effects) -> float:
    """Share of b that is the servo's position feedback: all of it unless an effect says otherwise."""
    saying = effects.torque_saturation or effects.linkage_geometry
    return saying.share if saying else 1.0
