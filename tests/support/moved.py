"""Motions for testing `synth`: short specs, and all effects of actuator and load with clearly visible sizes."""

from __future__ import annotations

import numpy as np

from synth.motion import Motion, command_rows, move
from synth.spec import Spec

PLANT = {"a": 26.0, "b": 524.0, "c": 508.0}
UNDAMPED = {"a": 0.0, "b": 524.0, "c": 508.0}
NECK = {"kind": "neck"}
STEP = np.array([[0.0, 0.0], [0.7, 15.0]])

COMMANDS = {
    "step": {},
    "stairs": {"levels_deg": [5, -10]},
    "paper_series": {"tread_s": 0.9},
    "triangle": {},
    "chirp": {},
    "release": {},
    "random": {},
    "free": {},
    "nod": {},
}
EVERYTHING = {
    "dead_time": {"tau_s": 0.0437},
    "actuator_lag": {"tau_s": 0.02},
    "rate_limit": {"r_deg_per_s": 120},
    "torque_saturation": {"limit": 50, "share": 0.8},
    "backlash": {"half_width_deg": 0.5},
    "dead_zone": {"half_width_deg": 0.4},
    "coulomb_friction": {"torque": 5, "downward": 4, "breakaway": 9, "stribeck_deg_per_s": 4},
    "quadratic_drag": {"q": 2},
    "stiffening_spring": {"k3": 300},
    "gravity_geometry": {"strength": 190, "gravity_deg": 45},
    "linkage_geometry": {"share": 0.8},
    "constant_torque": {"torque": 14},
    "one_sided_spring": {"stiffness": 100, "slack_deg": 3},
    "elastic_coupling": {"frequency_hz": 6},
    "periodic_disturbance": {"amplitude": 6, "frequency_hz": 1.7, "phase": 0.4},
    "time_varying_parameter": {"share": 0.5, "time_s": 2},
}
NOT_OF_A_NECK = ("dead_zone", "gravity_geometry", "linkage_geometry")


def spec_of(effects: dict, command: dict | None = None, plant: dict | None = None, **sections) -> Spec:
    """Return a validated spec with one recording."""
    recording = {"name": "x", "duration_s": 3.0, "command": command or {"kind": "step"}}
    return Spec.model_validate({"plant": plant or PLANT, "effects": effects, "recordings": [recording], **sections})


def moved(effects: dict, rows: np.ndarray | None = STEP, until: float = 3.0, **spec) -> Motion:
    """Return the motion for given command rows, whatever the command of the spec."""
    whole = spec_of(effects, **spec)
    return move(whole, whole.recordings[0], rows, until)


def performed(effects: dict, kind: str, until: float = 3.0, **spec) -> Motion:
    """Return the motion for one of the commands."""
    whole = spec_of(effects, {"kind": kind, **COMMANDS[kind]}, **spec)
    recording = whole.recordings[0]
    return move(whole, recording, command_rows(recording, np.random.SeedSequence(3)), until)


def let_go(
    effects: dict, angle_deg: float, until: float = 3.0, plant: dict | None = None, rest_s: float = 0.5
) -> Motion:
    """Return the motion of a head that is held and then released after the rest."""
    free = {"kind": "free", "initial_angle_deg": angle_deg, "rest_s": rest_s}
    return moved(effects, None, until, command=free, plant=plant or UNDAMPED)
