"""How the benchmarks draw effects: those of the ledger, and some outside it.

For each effect: the spec's keys that scale its size, the distribution of its other keys, and the true value of the
parameter that the loop reports.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from synth.camera import Pinhole

Keys = dict[str, float]
Rng = np.random.Generator


@dataclass(frozen=True)
class Drawn:
    """The distribution of one effect."""

    size: Keys
    """Keys that scale the size, with values whose residual is approximately 0.05°."""
    along: tuple[str, ...] = ()
    """Drawn keys that scale with them."""
    null: float = 0.0
    """Value of the scaled keys at which the effect vanishes."""
    inverse: bool = False
    """Whether smaller values mean a larger effect, as for a limit."""
    signed: bool = False
    """Whether the sign is random."""
    shape: Callable[[Rng], Keys] = lambda rng: {}
    """Draws the keys that do not change the size."""
    reported: Callable[[Keys, Pinhole, float], float] | None = None
    """Keys, camera and lever (m) → true value of the loop's first parameter, in the unit of the loop's file."""


def _same(key: str) -> Callable[[Keys, Pinhole, float], float]:
    return lambda keys, camera, lever: keys[key]


def _degrees(key: str) -> Callable[[Keys, Pinhole, float], float]:
    return lambda keys, camera, lever: math.degrees(keys[key])


def _any_way(rng: Rng) -> Keys:
    turn = rng.uniform(0, 2 * math.pi)
    return {"dx_px": 4 * math.cos(turn), "dy_px": 4 * math.sin(turn)}


CURVE = math.radians(15.0)
"""Command at which `anglecam.effects.command_curve` states the strength of its curve, rad."""


def _any_curve(rng: Rng) -> Keys:
    turn = rng.uniform(0, 2 * math.pi)
    return {"p_per_rad": 0.1 * math.cos(turn) / CURVE, "q_per_rad2": 0.1 * math.sin(turn) / CURVE**2}


LEDGER: Mapping[str, Drawn] = {
    "dead_time": Drawn({"tau_s": 0.002}, reported=_same("tau_s")),
    "actuator_lag": Drawn({"tau_s": 0.006}, reported=_same("tau_s")),
    "rate_limit": Drawn({"r_deg_per_s": 2000.0}, inverse=True, reported=_same("r_deg_per_s")),
    "torque_saturation": Drawn(
        {"limit": 120.0}, inverse=True, shape=lambda rng: {"share": rng.uniform(0.4, 1.0)}, reported=_degrees("limit")
    ),
    "backlash": Drawn({"half_width_deg": 0.07}, reported=_same("half_width_deg")),
    "dead_zone": Drawn({"half_width_deg": 0.07}, reported=_same("half_width_deg")),
    "coulomb_friction": Drawn(
        {"torque": 0.6},
        along=("breakaway",),
        shape=lambda rng: {} if rng.random() < 0.5 else {"breakaway": 0.6 * rng.uniform(1.1, 1.6)},
        reported=_degrees("torque"),
    ),
    "quadratic_drag": Drawn({"q": 0.3}, reported=_same("q")),
    "stiffening_spring": Drawn({"k3": 60.0}, signed=True, reported=_same("k3")),
    "gravity_geometry": Drawn(
        {"strength": 40.0},
        shape=lambda rng: {"gravity_deg": rng.uniform(-180, 180)},
        reported=_degrees("strength"),
    ),
    "linkage_geometry": Drawn(
        {"swing": 0.3}, shape=lambda rng: {"share": 1.0}, reported=lambda keys, camera, lever: 1.0
    ),
    "constant_torque": Drawn({"torque": 0.5}, signed=True, reported=_degrees("torque")),
    "load_dependent_friction": Drawn(
        {"share": 0.02}, shape=lambda rng: {"spring_share": rng.uniform(0, 0.8)}, reported=_same("share")
    ),
    "speed_dependent_torque": Drawn(
        {"stall": 100.0},
        inverse=True,
        shape=lambda rng: {"no_load_deg_per_s": rng.uniform(300, 600)},
        reported=_degrees("stall"),
    ),
    "cogging": Drawn(
        {"amplitude": 1.0},
        shape=lambda rng: {"periods_per_turn": rng.uniform(40, 120), "phase": rng.uniform(0, 2 * math.pi)},
        reported=_degrees("amplitude"),
    ),
    "end_stop": Drawn(
        {"upper_deg": 12.0},
        along=("lower_deg",),
        inverse=True,
        shape=lambda rng: {
            "lower_deg": -12.0 * rng.uniform(0.8, 1.2),
            "stiffness": rng.uniform(500, 4000),
            "dissipation": rng.uniform(0, 0.5),
        },
        reported=_same("stiffness"),
    ),
    "elastic_coupling": Drawn(
        {"inertia_share": 0.01},
        shape=lambda rng: {"frequency_hz": rng.uniform(2, 6), "damping_ratio": rng.uniform(0.01, 0.05)},
        reported=_same("inertia_share"),
    ),
    "one_sided_spring": Drawn(
        {"stiffness": 5.0},
        signed=True,
        shape=lambda rng: {"slack_deg": rng.uniform(-6, 6)},
        reported=_same("stiffness"),
    ),
    "periodic_disturbance": Drawn(
        {"amplitude": 0.6},
        shape=lambda rng: {"frequency_hz": rng.uniform(0.8, 5), "phase": rng.uniform(0, 2 * math.pi)},
        reported=_degrees("amplitude"),
    ),
    "time_varying_parameter": Drawn(
        {"share": 0.1},
        signed=True,
        shape=lambda rng: {"time_s": rng.uniform(10, 60)},
        reported=lambda keys, camera, lever: -keys["share"] / keys["time_s"],
    ),
    "command_curve": Drawn(
        {},
        along=("p_per_rad", "q_per_rad2"),
        shape=_any_curve,
        reported=lambda keys, camera, lever: math.hypot(keys["p_per_rad"] * CURVE, keys["q_per_rad2"] * CURVE**2),
    ),
    "perspective": Drawn(
        {"yaw_deg": 8.0},
        shape=lambda rng: {"axis_deg": rng.uniform(0, 180)},
        reported=lambda keys, camera, lever: abs(keys["yaw_deg"]),
    ),
    "camera_tilt": Drawn(
        {"tilt_deg": 8.0},
        shape=lambda rng: {"axis_deg": rng.uniform(0, 180)},
        reported=lambda keys, camera, lever: abs(keys["tilt_deg"]),
    ),
    "pivot_offset": Drawn(
        {},
        along=("dx_px", "dy_px"),
        shape=_any_way,
        reported=lambda keys, camera, lever: (
            (-1 if camera.mirrored else 1) * keys["dx_px"] * camera.distance_m / (camera.focal_px * lever)
        ),
    ),
    "lens_distortion": Drawn(
        {"k1": 0.1}, signed=True, reported=lambda keys, camera, lever: keys["k1"] * (lever / camera.distance_m) ** 2
    ),
    "rolling_shutter": Drawn({"row_time_s": 2e-5}, reported=_same("row_time_s")),
    "clock_scale": Drawn(
        {"scale": 1.001}, null=1.0, signed=True, reported=lambda keys, camera, lever: keys["scale"] - 1
    ),
    "angle_drift": Drawn({"rate_deg_per_s": 0.02}, signed=True, reported=_same("rate_deg_per_s")),
}
"""Effects of the ledger, by the ids of `anglecam.effects.LEDGER`."""

OUTSIDE: Mapping[str, Drawn] = {
    "hysteresis_spring": Drawn({"force": 0.8}, shape=lambda rng: {"width_deg": rng.uniform(0.5, 3)}),
    "detent": Drawn(
        {"force": 3.0}, shape=lambda rng: {"angle_deg": rng.uniform(-5, 5), "width_deg": rng.uniform(0.5, 1.5)}
    ),
    "shifted_load": Drawn({"torque": 0.5}, signed=True, shape=lambda rng: {"at_s": rng.uniform(2, 5)}),
    "wind_gusts": Drawn({"rms": 0.5}, shape=lambda rng: {"number": float(rng.integers(1000))}),
    "self_excitation": Drawn({"rate": 1.0}, shape=lambda rng: {"width_deg": rng.uniform(6, 12)}),
    "torque_walk": Drawn({"spread": 0.5}, shape=lambda rng: {"number": float(rng.integers(1000))}),
}
"""Effects outside the ledger; the right verdict is ``unexplained``."""

ALL = {**LEDGER, **OUTSIDE}

NUMBERED = (
    "actuator_lag", "angle_drift", "backlash", "camera_tilt", "clock_scale", "constant_torque", "coulomb_friction",
    "dead_time", "dead_zone", "elastic_coupling", "gravity_geometry", "lens_distortion", "linkage_geometry",
    "periodic_disturbance", "pivot_offset", "quadratic_drag", "rate_limit", "rolling_shutter", "one_sided_spring",
    "stiffening_spring", "torque_saturation", "time_varying_parameter", "cogging", "command_curve", "end_stop",
    "load_dependent_friction", "perspective", "speed_dependent_torque", "detent", "hysteresis_spring",
    "self_excitation", "shifted_load", "torque_walk", "wind_gusts",
)  # fmt: skip
"""The effects in an order that never changes, because a number in it is part of a draw's seed; append new ones."""


def draw(name: str, seed: int) -> dict[str, Keys]:
    """Draw one effect's signs and shape, with a typical size.

    Parameters
    ----------
    name : str
        An id of `ALL`.
    seed : int
        Seed of the session.

    Returns
    -------
    dict
        ``{name: keys}`` as in a film's spec, for `benchmarks.blind.sessions.scaled`.
    """
    effect = ALL[name]
    rng = np.random.default_rng([seed, NUMBERED.index(name), 1])
    sign = float(rng.choice([-1.0, 1.0])) if effect.signed else 1.0
    sizes = {key: effect.null + sign * (value - effect.null) for key, value in effect.size.items()}
    return {name: sizes | effect.shape(rng)}


def magnified(name: str, keys: Keys, factor: float) -> Keys:
    """Return an effect ``factor`` times as large: limits shrink, other sizes grow."""
    effect = ALL[name]

    def grown(value: float) -> float:
        return value / factor if effect.inverse else effect.null + factor * (value - effect.null)

    grows = (*effect.size, *effect.along)
    return {key: grown(value) if key in grows else value for key, value in keys.items()}
