"""Mechanisms whose model lacks something, simulated by code that shares nothing with the package.

MuJoCo simulates a servo with its load, limits and friction; plain Euler steps of 50 microseconds simulate the others.
`KINDS` holds them, each with the sets of effects that a verdict may name.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Played = tuple[Floats, Floats]
"""Instants, s, and levels, degrees, of a command that is held."""

SECONDS = 10.0
"""Duration of a recording."""
EULER_S, MUJOCO_S = 5e-5, 1e-4
"""Steps."""
INERTIA = 0.002
"""Of the servo and its arm, kg·m²."""
LOAD_KG = 0.25


def held(command: Played, at: Floats) -> Floats:
    """Return a command at some instants."""
    return command[1][np.clip(np.searchsorted(command[0], at, side="right") - 1, 0, None)]


@dataclass(frozen=True)
class Drawn:
    """What a seed draws."""

    rng: np.random.Generator
    amplitude: float
    """Of the commands, rad."""
    a: float
    b: float
    gain: float

    def level(self, low: float, high: float) -> float:
        """Return a drawn acceleration: the spring's at so many degrees."""
        return self.b * np.radians(self.rng.uniform(low, high))


Right = Callable[[float, float, float, float, dict[str, float]], float]
"""(t, θ, ω, u, memory) → θ̈; SI."""


def euler(right: Right, friction: float = 0.0, delay: float = 0.0) -> Callable[[Played], Played]:
    """Return a simulation by semi-implicit Euler steps, with Coulomb friction as a bounded impulse."""

    def run(command: Played) -> Played:
        at = np.arange(0.0, SECONDS, EULER_S)
        u, memory = np.radians(held(command, at - delay)), {"h": EULER_S}
        theta, omega, angle = 0.0, 0.0, np.empty(len(at))
        for i in range(len(at)):
            angle[i] = theta
            omega += EULER_S * right(at[i], theta, omega, u[i], memory)
            omega = np.sign(omega) * max(abs(omega) - friction * EULER_S, 0.0)
            theta += EULER_S * omega
        return at, angle

    return run


def servo(
    drawn: Drawn, *, load: float = 0.0, friction: float = 0.0, joint: str = "", motor: str = ""
) -> Callable[[Played], Played]:
    """Return MuJoCo's simulation of a hinge with a position actuator and a mass on an arm; gravity acts on the mass."""
    arm = drawn.rng.uniform(0.06, 0.1)
    whole = INERTIA + load * arm**2
    model = mujoco.MjModel.from_xml_string(f"""
        <mujoco>
          <option timestep="{MUJOCO_S}" gravity="0 0 {-9.81 if load else 0}" integrator="implicitfast"/>
          <worldbody><body>
            <joint name="j" axis="0 1 0" armature="{INERTIA}" frictionloss="{friction * whole}" {joint}/>
            <geom type="sphere" size="0.01" mass="{load or 1e-6}" pos="{arm} 0 0"/>
          </body></worldbody>
          <actuator><position joint="j" kp="{drawn.b * whole}" kv="{drawn.a * whole}" {motor}/></actuator>
        </mujoco>""")

    def run(command: Played) -> Played:
        data, at = mujoco.MjData(model), np.arange(0.0, SECONDS, MUJOCO_S)
        u, angle = np.radians(held(command, at)), np.empty(len(at))
        for i in range(len(at)):
            angle[i], data.ctrl[0] = data.qpos[0], u[i]
            mujoco.mj_step(model, data)
        return at, angle

    return run


def limited(d: Drawn) -> Callable[[Played], Played]:
    torque = INERTIA * d.b * d.amplitude * d.rng.uniform(0.7, 1.1)
    return servo(d, motor=f'forcerange="{-torque} {torque}"')


def stopped(d: Drawn) -> Callable[[Played], Played]:
    stop = np.degrees(d.amplitude) * d.rng.uniform(0.6, 0.85)
    return servo(d, joint=f'limited="true" range="-90 {stop}" solreflimit="-3000 -40"')


def drive(drawn: Drawn, u: float, theta: float, omega: float) -> float:
    """Return θ̈ of the base model."""
    return drawn.gain * drawn.b * u - drawn.a * omega - drawn.b * theta


def quadratic_drag(d: Drawn) -> Callable[[Played], Played]:
    q = d.rng.uniform(1.0, 4.0)
    return euler(lambda t, x, w, u, m: drive(d, u, x, w) + 0.5 * d.a * w - q * abs(w) * w)


def dead_band(d: Drawn) -> Callable[[Played], Played]:
    width = np.radians(d.rng.uniform(0.8, 2.0))
    return euler(lambda t, x, w, u, m: d.b * np.sign(u - x) * max(abs(u - x) - width, 0.0) - d.a * w)


def profile(d: Drawn) -> Callable[[Played], Played]:
    rate = np.radians(d.rng.uniform(60.0, 140.0))

    def right(t: float, x: float, w: float, u: float, m: dict[str, float]) -> float:
        goal = m.get("goal", 0.0)
        m["goal"] = goal + float(np.clip(u - goal, -rate * m["h"], rate * m["h"]))
        return drive(d, m["goal"], x, w)

    return euler(right)


def cogged(d: Drawn) -> Callable[[Played], Played]:
    torque, period = d.level(0.5, 1.2), np.radians(d.rng.uniform(4.0, 9.0))
    return euler(lambda t, x, w, u, m: drive(d, u, x, w) + torque * np.sin(2.0 * np.pi * x / period))


def uneven_damping(d: Drawn) -> Callable[[Played], Played]:
    share = d.rng.uniform(0.25, 0.5)
    return euler(lambda t, x, w, u, m: drive(d, u, x, w) - share * d.a * abs(w))


def warming(d: Drawn) -> Callable[[Played], Played]:
    more = d.rng.uniform(0.3, 0.6)
    return euler(lambda t, x, w, u, m: drive(d, u, x, w) - d.a * more * (1.0 - np.exp(-t / 6.0)) * w)


def hanging_load(d: Drawn) -> Callable[[Played], Played]:
    frequency, mass = d.rng.uniform(7.0, 12.0), d.rng.uniform(0.1, 0.25)

    def right(t: float, x: float, w: float, u: float, m: dict[str, float]) -> float:
        place, rate = m.get("place", 0.0), m.get("rate", 0.0)
        pull = frequency**2 * (place - x) + 0.06 * frequency * (rate - w)
        m["rate"] = rate - m["h"] * pull
        m["place"] = place + m["h"] * m["rate"]
        return drive(d, u, x, w) + mass * pull

    return euler(right)


def integral_action(d: Drawn) -> Callable[[Played], Played]:
    gain = d.b * d.rng.uniform(0.8, 2.0)

    def right(t: float, x: float, w: float, u: float, m: dict[str, float]) -> float:
        m["sum"] = m.get("sum", 0.0) + m["h"] * (u - x)
        return 0.9 * d.b * (u - x) + gain * m["sum"] - d.a * w

    return euler(right)


def falling_supply(d: Drawn) -> Callable[[Played], Played]:
    share = d.rng.uniform(0.06, 0.12)
    return euler(lambda t, x, w, u, m: drive(d, u * (1.0 - share * t / SECONDS), x, w))


def presliding(d: Drawn) -> Callable[[Played], Played]:
    """Dahl, A solid friction model, 1968: the friction grows with the distance from the last reversal."""
    level = d.level(1.0, 2.5)
    stiffness = level / np.radians(0.6)

    def right(t: float, x: float, w: float, u: float, m: dict[str, float]) -> float:
        bristle = m.get("bristle", 0.0)
        m["bristle"] = bristle + m["h"] * w * (1.0 - stiffness * bristle / level * np.sign(w))
        return drive(d, u, x, w) - stiffness * bristle

    return euler(right)


def breeze(d: Drawn) -> Callable[[Played], Played]:
    def run(command: Played) -> Played:
        gusts = d.b * np.radians(d.rng.normal(size=int(4.0 * SECONDS) + 2))
        at = np.arange(0.0, SECONDS, EULER_S)
        torque = np.interp(4.0 * at, np.arange(len(gusts)), gusts)
        return euler(lambda t, x, w, u, m: drive(d, u, x, w) + torque[round(t / EULER_S)])(command)

    return run


def frames_of_pulses(d: Drawn) -> Callable[[Played], Played]:
    """Read the command every 20 ms, as a hobby servo does; it changes in between."""
    run, frames = euler(lambda t, x, w, u, m: drive(d, u, x, w), delay=0.01), np.arange(0.0, SECONDS, 0.02)
    return lambda command: run((frames, held(command, frames)))


KINDS: dict[str, tuple[Callable[[Drawn], Callable[[Played], Played]], tuple[set[str], ...]]] = {
    "nothing, MuJoCo": (servo, (set(),)),
    "nothing, Euler": (lambda d: euler(lambda t, x, w, u, m: drive(d, u, x, w)), (set(),)),
    "gravity, MuJoCo": (lambda d: servo(d, load=LOAD_KG), ({"gravity_geometry"},)),
    "torque limit, MuJoCo": (limited, ({"torque_saturation"}, {"speed_dependent_torque"})),
    "stop, MuJoCo": (stopped, ({"end_stop"},)),
    "regularised friction, MuJoCo": (lambda d: servo(d, friction=d.level(0.8, 2.5)), ()),
    "friction": (
        lambda d: euler(lambda t, x, w, u, m: drive(d, u, x, w), friction=d.level(0.8, 2.5)),
        ({"coulomb_friction"},),
    ),
    "delay": (
        lambda d: euler(lambda t, x, w, u, m: drive(d, u, x, w), delay=d.rng.uniform(0.012, 0.03)),
        ({"dead_time"},),
    ),
    "drag": (quadratic_drag, ({"quadratic_drag"},)),
    "dead band of the control": (dead_band, ({"dead_zone"}, {"backlash"})),
    "speed limit in the firmware": (profile, ({"rate_limit"},)),
    "cogging": (cogged, ({"cogging"},)),
    "uneven damping": (uneven_damping, ({"damping_asymmetry"},)),
    "warming": (warming, ({"time_varying_parameter"},)),
    "hanging load": (hanging_load, ({"elastic_coupling"},)),
    "integral action": (integral_action, ()),
    "falling supply": (falling_supply, ({"time_varying_parameter"},)),
    "presliding friction": (presliding, ()),
    "gusts": (breeze, ()),
    "a pulse every 20 ms": (frames_of_pulses, ()),
}
"""Mechanism → its simulation, and the sets of effects that are right; none where only what is left can be right."""
