"""The effects as a benchmark draws them: the eighteen of the ledger, and four that are in no ledger.

For each: which of the truth's keys make it larger, how the others are drawn, and what number the loop should find.
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
    """How one effect is drawn."""

    size: Keys
    """Keys that grow together, with what is about a noise of 0.05°."""
    along: tuple[str, ...] = ()
    """Drawn keys that grow with them."""
    null: float = 0.0
    """Where those keys leave the motion as it was."""
    inverse: bool = False
    """Whether smaller is more, as of a limit."""
    signed: bool = False
    """Whether it may go either way."""
    shape: Callable[[Rng], Keys] = lambda rng: {}
    """Draw what makes it neither larger nor smaller."""
    told: Callable[[Keys, Pinhole, float], float] | None = None
    """Truth, camera and lever (m) → the loop's first parameter, in its file's unit."""


def _same(key: str) -> Callable[[Keys, Pinhole, float], float]:
    return lambda keys, camera, lever: keys[key]


def _degrees(key: str) -> Callable[[Keys, Pinhole, float], float]:
    return lambda keys, camera, lever: math.degrees(keys[key])


def _any_way(rng: Rng) -> Keys:
    turn = rng.uniform(0, 2 * math.pi)
    return {"dx_px": 4 * math.cos(turn), "dy_px": 4 * math.sin(turn)}


LEDGER: Mapping[str, Drawn] = {
    "dead_time": Drawn({"tau_s": 0.002}, told=_same("tau_s")),
    "actuator_lag": Drawn({"tau_s": 0.006}, told=_same("tau_s")),
    "rate_limit": Drawn({"r_deg_per_s": 2000.0}, inverse=True, told=_same("r_deg_per_s")),
    "torque_saturation": Drawn(
        {"limit": 120.0}, inverse=True, shape=lambda rng: {"share": rng.uniform(0.4, 1.0)}, told=_degrees("limit")
    ),
    "backlash": Drawn({"half_width_deg": 0.07}, told=_same("half_width_deg")),
    "dead_zone": Drawn({"half_width_deg": 0.07}, told=_same("half_width_deg")),
    "coulomb_friction": Drawn(
        {"torque": 0.6},
        along=("breakaway",),
        shape=lambda rng: {} if rng.random() < 0.5 else {"breakaway": 0.6 * rng.uniform(1.1, 1.6)},
        told=_degrees("torque"),
    ),
    "quadratic_drag": Drawn({"q": 0.3}, told=_same("q")),
    "stiffening_spring": Drawn({"k3": 60.0}, signed=True, told=_same("k3")),
    "gravity_geometry": Drawn(
        {"strength": 40.0},
        shape=lambda rng: {"gravity_deg": rng.uniform(-180, 180)},
        told=_degrees("strength"),
    ),
    "linkage_geometry": Drawn({"swing": 0.3}, shape=lambda rng: {"share": 1.0}, told=lambda keys, camera, lever: 1.0),
    "constant_torque": Drawn({"torque": 0.5}, signed=True, told=_degrees("torque")),
    "camera_tilt": Drawn(
        {"tilt_deg": 8.0},
        shape=lambda rng: {"axis_deg": rng.uniform(0, 180)},
        told=lambda keys, camera, lever: abs(keys["tilt_deg"]),
    ),
    "pivot_offset": Drawn(
        {},
        along=("dx_px", "dy_px"),
        shape=_any_way,
        told=lambda keys, camera, lever: (
            (-1 if camera.mirrored else 1) * keys["dx_px"] * camera.distance_m / (camera.focal_px * lever)
        ),
    ),
    "lens_distortion": Drawn(
        {"k1": 0.1}, signed=True, told=lambda keys, camera, lever: keys["k1"] * (lever / camera.distance_m) ** 2
    ),
    "rolling_shutter": Drawn({"row_time_s": 2e-5}, told=_same("row_time_s")),
    "clock_scale": Drawn({"scale": 1.001}, null=1.0, signed=True, told=lambda keys, camera, lever: keys["scale"] - 1),
    "angle_drift": Drawn({"rate_deg_per_s": 0.02}, signed=True, told=_same("rate_deg_per_s")),
}
"""Under the ids of `anglecam.effects.LEDGER`."""

OUTSIDE: Mapping[str, Drawn] = {
    "slack_spring": Drawn({"stiffness": 5.0}, shape=lambda rng: {"slack_deg": rng.uniform(-6, 6)}),
    "flexible_appendage": Drawn(
        {"inertia_share": 0.01},
        shape=lambda rng: {"frequency_hz": rng.uniform(2, 6), "damping_ratio": rng.uniform(0.01, 0.05)},
    ),
    "periodic_disturbance": Drawn(
        {"amplitude": 0.6},
        shape=lambda rng: {"frequency_hz": rng.uniform(0.8, 5), "phase": rng.uniform(0, 2 * math.pi)},
    ),
    "warming_damping": Drawn({"share": 0.1}, shape=lambda rng: {"work": rng.uniform(5, 30)}),
}
"""Right is ``unexplained``."""

ALL = {**LEDGER, **OUTSIDE}


def draw(name: str, seed: int) -> dict[str, Keys]:
    """Draw one effect's signs and shape; its size is a typical one.

    Parameters
    ----------
    name : str
        An id of `ALL`.
    seed : int
        The session's.

    Returns
    -------
    dict
        ``{name: keys}`` as a film's spec has it, for `benchmarks.blind.sessions.scaled`.
    """
    effect = ALL[name]
    rng = np.random.default_rng([seed, sorted(ALL).index(name), 1])
    sign = float(rng.choice([-1.0, 1.0])) if effect.signed else 1.0
    sizes = {key: effect.null + sign * (value - effect.null) for key, value in effect.size.items()}
    return {name: sizes | effect.shape(rng)}


def magnified(name: str, keys: Keys, factor: float) -> Keys:
    """Return an effect ``factor`` times as large: what is absent at nought grows, a limit shrinks."""
    effect = ALL[name]

    def grown(value: float) -> float:
        return value / factor if effect.inverse else effect.null + factor * (value - effect.null)

    grows = (*effect.size, *effect.along)
    return {key: grown(value) if key in grows else value for key, value in keys.items()}
