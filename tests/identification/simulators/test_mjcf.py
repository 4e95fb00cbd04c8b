"""The exported MJCF, run in MuJoCo, predicts a held-out recording as well as the fitted model, or says why not."""

from __future__ import annotations

import json
import math

import mujoco
import numpy as np
import pytest

from anglecam.effects import effect
from anglecam.identification.output_error import fit_output_error, predict_output_error
from anglecam.identification.simulators.mechanism import Mechanism, read_mechanism
from anglecam.identification.simulators.mjcf import mjcf_of
from anglecam.models.plant import Plant
from benchmarks.blind.sessions import session, spec_of
from support.motion import Plant as TruePlant
from support.motion import Recording
from support.series import record

SEED = 2
EXPRESSED = {
    "linear": ({}, (), ()),
    "dead_time": ({"tau_s": 0.023}, (0.02,), ()),
    "actuator_lag": ({"tau_s": 0.02}, (0.02,), ()),
    "rate_limit": ({"r_deg_per_s": 300.0}, (1.0 / math.radians(300.0),), ()),
    "torque_saturation": ({"limit": 80.0, "share": 0.7}, (1.0 / 80.0, 0.7), ()),
    "coulomb_friction": ({"torque": 3.0}, (3.0,), ("asymmetry_deg_per_s2", "breakaway_excess_deg_per_s2")),
    "quadratic_drag": ({"q": 2.0}, (2.0,), ()),
    "stiffening_spring": ({"k3": 600.0}, (600.0,), ()),
    "gravity_geometry": ({"strength": 150.0, "gravity_deg": 50.0}, (150.0, math.radians(50.0)), ()),
}
"""Effect → its keys in `synth`, where the fit starts, and parameters that are not fitted."""


IN_EVERY_RUN = ("dead_time", "coulomb_friction")
"""Fitted to a session in every run of the tests; the others are in the sweep."""


def plant_of(name):
    """Return the plant with an effect, and its parameters where the fit starts."""
    _, starts, absent = EXPRESSED[name]
    effects = ()
    if name != "linear":
        one = effect(name)
        fixed = {p.name: p.null for p in one.parameters[len(starts) :]}
        assert set(absent) <= set(fixed) or not absent
        effects = (one.with_fixed(fixed),)
    true = spec_of({}, seed=SEED).plant
    return Plant(effects), np.array([true.a, true.b, true.c, *starts])


def fitted(name):
    """Return the fit of a session with one effect, and its held-out recording."""
    keys = EXPRESSED[name][0]
    records = session({} if name == "linear" else {name: keys}, seed=SEED, names=("stairs", "chirp", "random"))
    plant, begin = plant_of(name)
    fit = fit_output_error(plant, [r for r in records if r.name in ("stairs", "chirp")], [begin])
    return fit, [next(r for r in records if r.name == "random")]


def loop_json(plant, parameters, path):
    """Write what `close` writes of a fitted plant, as far as it is read back."""
    base = plant.base_count
    values = dict(zip(plant.names, parameters.tolist(), strict=True))
    effects = [
        {"id": e.id, "parameters": {p.name: {"value": p.in_file_unit(values[p.name])[0]} for p in e.parameters}}
        for e in plant.effects
    ]
    model = {name: {"value": values[name]} for name in plant.names[:base]}
    path.write_text(json.dumps({"verdict": "attributed", "model": model, "effects": effects}))
    return path


def simulated(text, record, nuisance):
    """Return the angle that MuJoCo simulates at a recording's frames from its fitted initial state, rad."""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[0], data.qvel[0] = nuisance[:2]
    step = model.opt.timestep
    count = math.ceil((record.time[-1] - record.time[0]) / step) + 1
    grid = record.time[0] + step * np.arange(count + 1)
    fine = record.command.at(grid[:-1, None] + step * (np.arange(8) + 0.5) / 8)
    angle = np.empty(count + 1)
    for i, u in enumerate(fine.mean(axis=1)):
        angle[i] = data.qpos[0]
        if model.nu:
            data.ctrl[0] = u
        mujoco.mj_step(model, data)
    angle[count] = data.qpos[0]
    return np.interp(record.time, grid, angle) + nuisance[2:].sum()


@pytest.fixture(scope="module")
def steps():
    """Return a recording of steps."""
    return record(TruePlant(), Recording("steps"), np.random.default_rng(0), sigma_deg=0.0)


@pytest.mark.parametrize(("name", "inertia"), [*((name, 1.0) for name in EXPRESSED), ("torque_saturation", 3e-3)])
def test_mujoco_moves_as_the_plant_with_the_same_parameters(name, inertia, steps, tmp_path):
    plant, parameters = plant_of(name)
    exported = mjcf_of(read_mechanism(loop_json(plant, parameters, tmp_path / "loop.json")), inertia)
    assert exported.left_out == ()
    moved = plant.predict(parameters, steps.time, steps.command, np.zeros(2))
    off = moved - simulated(exported.text, steps, np.zeros(2))
    # added to the noise of 0.05°, a difference of 0.023° makes the RMS error of a prediction 1.1 times as large
    assert np.degrees(np.sqrt(np.mean(off**2))) < 0.023
    assert np.degrees(np.ptp(moved)) > 5.0


@pytest.mark.parametrize(
    ("name", "inertia"),
    [(name, 1.0) if name in IN_EVERY_RUN else pytest.param(name, 1.0, marks=pytest.mark.sweep) for name in EXPRESSED]
    + [pytest.param("torque_saturation", 3e-3, marks=pytest.mark.sweep)],
)
def test_mujoco_predicts_the_held_out_recording_as_well_as_the_model(name, inertia, tmp_path):
    fit, held_out = fitted(name)
    ours = predict_output_error(fit, held_out)
    exported = mjcf_of(read_mechanism(loop_json(fit.model, fit.parameters, tmp_path / "loop.json")), inertia)
    assert exported.left_out == ()
    theirs = simulated(exported.text, held_out[0], ours.nuisance[0])
    rmse = float(np.sqrt(np.mean((held_out[0].angle - theirs) ** 2)))
    assert np.degrees(ours.rmse) < 0.06  # the noise is 0.05°
    assert rmse < 1.1 * ours.rmse


@pytest.mark.parametrize(
    ("effects", "said"),
    [
        ({"backlash": {"half_width_deg": 0.01}}, "backlash: MuJoCo's joint and actuator cannot express it"),
        ({"dead_zone": {"threshold_deg": 0.01}}, "dead_zone: MuJoCo's joint and actuator cannot express it"),
        ({"camera_tilt": {}}, "camera_tilt: an effect of the camera"),
        ({"dead_time": {"tau_s": -0.01}}, "dead_time: it is negative"),
        (
            {"coulomb_friction": {"friction_deg_per_s2": 1.0, "breakaway_excess_deg_per_s2": 0.5}},
            "frictionloss has no breakaway torque above the sliding one",
        ),
        ({"gravity_geometry": {"gravity_deg_per_s2": 40.0}}, "its direction gravity_deg is not in the file"),
        ({"end_stop": {"upper_stop_deg": 0.2}}, "end_stop: written as the joint's range"),
        ({"rate_limit": {"rate_deg_per_s": 5.0}, "actuator_lag": {"lag_s": 0.02}}, "no lag behind a speed limit"),
    ],
)
def test_what_mujoco_cannot_express_is_said_in_the_file_and_returned(effects, said):
    exported = mjcf_of(Mechanism("rig", 26.0, 524.0, 508.0, effects))
    assert len(exported.left_out) == 1
    assert said in exported.left_out[0]
    assert f"NOT EXPRESSED: {exported.left_out[0]}" in exported.text
    mujoco.MjModel.from_xml_string(exported.text)


def test_a_free_pendulum_has_no_actuator_and_swings_about_neutral():
    gravity = {"gravity_geometry": {"gravity_deg_per_s2": 50.0, "gravity_deg": math.radians(150.0)}}
    exported = mjcf_of(Mechanism('a & "b"', 0.5, 60.0, None, gravity))
    assert exported.left_out == ("no command was recorded: the joint has no actuator",)
    model = mujoco.MjModel.from_xml_string(exported.text)
    data = mujoco.MjData(model)
    data.qpos[0] = 0.1
    mujoco.mj_forward(model, data)
    turned = math.radians(150.0)
    expected = -60.0 * 0.1 + 50.0 * (math.sin(turned + 0.1) - math.sin(turned) - 0.1 * math.cos(turned))
    assert model.nu == 0
    assert data.qacc[0] == pytest.approx(expected, rel=1e-9)
