"""Every effect of the ledger against a reference that shares no code with it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import yaml

from anglecam.data.camera_evidence import UNKNOWN_VIEW, View
from anglecam.data.command import Command
from anglecam.effects import LEDGER, effect
from anglecam.models.plant import Plant
from synth.motion import command_rows, move
from synth.spec import read_spec

ABC = np.array([26.0, 524.0, 508.0])
TIME = np.arange(0.0, 6.0, 1 / 30)
COMMANDS = {
    "stairs": {"kind": "stairs", "levels_deg": [12, -9, 15, 0, -15, 6]},
    "chirp": {"kind": "chirp", "amplitude_deg": 9, "from_hz": 0.3, "to_hz": 5.0},
    "triangle": {"kind": "triangle", "amplitude_deg": 14, "period_s": 4.0},
}


def bent(p: float, q: float) -> list[float]:
    """Return strength and shape of the curve whose slope is e^(p·u + q·u²)."""
    unit = math.radians(15.0)
    return [math.hypot(p * unit, q * unit**2), math.atan2(q * unit, p)]


MOVED = {
    "dead_time": ({"tau_s": 0.0437}, [0.0437]),
    "actuator_lag": ({"tau_s": 0.05}, [0.05]),
    "rate_limit": ({"r_deg_per_s": 150.0}, [1.0 / math.radians(150.0)]),
    "torque_saturation": ({"limit": 60.0, "share": 0.7}, [1.0 / 60.0, 0.7]),
    "backlash": ({"half_width_deg": 0.8}, [math.radians(0.8)]),
    "dead_zone": ({"half_width_deg": 0.8}, [math.radians(0.8)]),
    "coulomb_friction": ({"torque": 6.0, "downward": 4.0, "breakaway": 8.0}, [5.0, 1.0, 3.0]),
    "quadratic_drag": ({"q": 2.0}, [2.0]),
    "stiffening_spring": ({"k3": 400.0}, [400.0]),
    "gravity_geometry": ({"strength": 140.0, "gravity_deg": 45.0}, [140.0, math.radians(45.0)]),
    "linkage_geometry": ({"share": 1.0}, [1.0]),
    "constant_torque": ({"torque": 5.0}, [5.0]),
    "load_dependent_friction": ({"share": 0.12, "spring_share": 0.4}, [0.12, 0.4]),
    "speed_dependent_torque": ({"stall": 60.0, "no_load_deg_per_s": 250.0}, [1.0 / 60.0, 1.0 / math.radians(250.0)]),
    "cogging": ({"amplitude": 6.0, "periods_per_turn": 60.0, "phase": 0.4}, [6.0, 60.0, 0.4]),
    "end_stop": (
        {"stiffness": 8000.0, "upper_deg": 9.0, "lower_deg": -8.0, "dissipation": 0.3},
        [8000.0, 1.0 / math.radians(9.0), -1.0 / math.radians(8.0), 0.3],
    ),
    "one_sided_spring": ({"stiffness": -150.0, "slack_deg": 2.0}, [-150.0, math.radians(2.0)]),
    "elastic_coupling": ({"frequency_hz": 3.0, "damping_ratio": 0.05, "inertia_share": 0.2}, [0.2, 3.0, 0.05]),
    "periodic_disturbance": ({"amplitude": 6.0, "frequency_hz": 1.7, "phase": 0.4}, [6.0, 1.7, 0.4]),
    "time_varying_parameter": ({"share": 0.5, "time_s": 3.0}, [-0.5 / 3.0, 1.0 / 3.0]),
    "command_curve": ({"p_per_rad": 0.8, "q_per_rad2": 4.0}, bent(0.8, 4.0)),
}
CONTACT_DEG = {"end_stop": 2e-3}
"""Where a step in which the body meets a stop is of second order; see the effect's module."""
UNITS = {"", "s", "deg", "deg/s", "deg/s2", "1/s", "1/s2", "1/rad", "s/rad", "Hz"}
VIEW = View(neutral=math.radians(20.0), lever_px=200.0, pivot_px=(-80.0, 60.0))
NOD = np.radians(np.linspace(-25.0, 25.0, len(TIME)))


@pytest.mark.parametrize(
    "kind", ["stairs", *(pytest.param(kind, marks=pytest.mark.sweep) for kind in COMMANDS if kind != "stairs")]
)
@pytest.mark.parametrize("effect_id", MOVED)
def test_motion_with_an_effect_equals_the_laboratorys(tmp_path, effect_id, kind):
    truth, parameters = MOVED[effect_id]
    recording = {"name": "r", "duration_s": 6.0, "command": COMMANDS[kind]}
    plant = dict(zip("abc", ABC.tolist(), strict=True))
    (tmp_path / "s.yaml").write_text(
        yaml.safe_dump({"plant": plant, "effects": {effect_id: truth}, "recordings": [recording]})
    )
    spec = read_spec(tmp_path / "s.yaml")
    rows = command_rows(spec.recordings[0], np.random.SeedSequence(3))
    true = move(spec, spec.recordings[0], rows, 6.0).angle(TIME)
    command = Command(rows[:, 0], np.radians(rows[:, 1]))
    model = Plant((effect(effect_id),))
    predicted = model.predict(np.append(ABC, parameters), TIME, command, np.array([true[0], 0.0]))
    assert np.degrees(np.abs(predicted - true)).max() < CONTACT_DEG.get(effect_id, 2e-4)


def _observe(effect_id: str, *parameters: float) -> np.ndarray:
    return effect(effect_id).observation(TIME, NOD, np.array(parameters), VIEW)


def _line(place: np.ndarray, pivot: np.ndarray) -> np.ndarray:
    arm = place - pivot
    line = np.arctan2(arm[..., 1], arm[..., 0])
    return np.unwrap(line) if line.ndim else line


def _mark() -> np.ndarray:
    return np.stack([np.cos(VIEW.neutral + NOD), np.sin(VIEW.neutral + NOD)], axis=-1)


def _zeroed(line: np.ndarray) -> np.ndarray:
    return line - np.interp(0.0, NOD, line)


def test_a_pivot_beside_the_axis_turns_the_line():
    wrong = np.array([0.25, -0.15])
    at_rest = np.array([np.cos(VIEW.neutral), np.sin(VIEW.neutral)])
    view = replace(VIEW, neutral=float(_line(at_rest, wrong)))  # neutral is known only as measured from there
    found = effect("pivot_offset").observation(TIME, NOD, wrong, view)
    assert _zeroed(found) == pytest.approx(_zeroed(_line(_mark(), wrong)), abs=2e-6)


def test_a_tilted_camera_shortens_lengths_across_its_axis():
    tilt, axis = math.radians(15.0), math.radians(30.0)
    along = np.array([math.cos(axis), math.sin(axis)])
    across = np.array([-along[1], along[0]])
    mark = _mark()
    height = 0.8
    shown = (mark @ along)[:, None] * along + math.cos(tilt) * (mark @ across)[:, None] * across
    shown -= height * math.sin(tilt) * across  # the line goes from a mark that stands before the plane
    expected = _zeroed(_line(shown, np.zeros(2)))
    assert _zeroed(_observe("camera_tilt", tilt, axis, height)) == pytest.approx(expected, abs=2e-6)


def test_a_lens_displaces_mark_and_pivot_about_the_middle_of_the_picture():
    kappa, centre = -0.04, np.array([VIEW.pivot_px[0], -VIEW.pivot_px[1]]) / VIEW.lever_px

    def drawn(place):
        return place * (1.0 + kappa * (place**2).sum(axis=-1, keepdims=True))

    at_rest = np.array([np.cos(VIEW.neutral), np.sin(VIEW.neutral)])
    pivot, arm = drawn(centre), drawn(centre + at_rest) - drawn(centre)
    lever = VIEW.lever_px * float(np.hypot(*arm))
    x, y = VIEW.lever_px * pivot
    view = View(float(np.arctan2(arm[1], arm[0])), lever, (float(x), float(-y)))  # all that the picture shows
    found = effect("lens_distortion").observation(TIME, NOD, np.array([kappa]), view)
    assert _zeroed(found) == pytest.approx(_zeroed(_line(drawn(centre + _mark()), pivot)), abs=2e-6)


def test_a_mark_lower_in_the_picture_is_recorded_later():
    row_time, plant = 3e-5, Plant((effect("rolling_shutter"),))
    command = Command(np.array([0.0, 0.5, 2.0]), np.radians([0.0, 20.0, -10.0]))
    fine = np.arange(0.0, 6.2, 1e-4)
    angle = Plant().predict(ABC, fine, command, np.zeros(2))
    # the shutter passes the mark when both are at the same row
    late = fine - row_time * (VIEW.pivot_px[1] - VIEW.lever_px * np.sin(VIEW.neutral + angle))
    expected = np.interp(TIME, late, angle)
    predicted = plant.predict(np.append(ABC, row_time), TIME, command, np.zeros(2), VIEW)
    assert np.degrees(np.abs(predicted - expected))[1:].max() < 0.02
    assert np.degrees(np.abs(np.interp(TIME, fine, angle) - expected)).max() > 0.3


def test_clock_scale_stretches_the_command_and_drift_is_linear():
    command = Command(np.array([0.0, 1.0, 3.0]), np.radians([0.0, 10.0, -5.0]))
    later = Command(command.time * 1.01, command.angle)
    scaled = Plant((effect("clock_scale"),)).predict(np.append(ABC, 0.01), TIME, command, np.zeros(2))
    assert scaled == pytest.approx(Plant().predict(ABC, TIME, later, np.zeros(2)), abs=1e-12)
    assert _observe("angle_drift", 0.01) == pytest.approx(NOD + 0.01 * TIME, abs=1e-15)


def test_the_ledger_is_the_contracts():
    assert {e.id for e in LEDGER} >= {*MOVED, "camera_tilt", "pivot_offset", "lens_distortion", "rolling_shutter"}
    assert {e.id for e in LEDGER} >= {"clock_scale", "angle_drift", "damping_asymmetry"}
    assert len({e.id for e in LEDGER}) == len(LEDGER)
    names = [p.name for e in LEDGER for p in e.parameters]
    assert len(set(names)) == len(names)
    assert {p.unit for e in LEDGER for p in e.parameters} <= UNITS
    for e in LEDGER:
        assert set(e.aliases) < {other.id for other in LEDGER} - {e.id}
        assert e.needs(VIEW)
    assert not effect("rolling_shutter").needs(UNKNOWN_VIEW)


@pytest.mark.parametrize("lag", [1e-6, 1e-4, 1e-3, 1e-2])
def test_a_lag_of_any_length_is_as_accurate_with_a_nonlinear_effect_as_alone(lag):
    time = np.arange(0.0, 4.0, 1.0 / 30.0)
    command = Command(np.array([0.0, 0.5, 1.5, 2.7]), np.radians([0.0, 10.0, -8.0, 12.0]))
    alone, beside = Plant((effect("actuator_lag"),)), Plant((effect("actuator_lag"), effect("quadratic_drag")))
    exact = alone.predict(np.array([26.0, 524.0, 508.0, lag]), time, command, np.zeros(2))
    near = beside.predict(np.array([26.0, 524.0, 508.0, lag, 0.0]), time, command, np.zeros(2))
    assert np.degrees(np.abs(near - exact)).max() < 1e-4


def test_parameters_that_are_fixed_one_after_another_keep_their_places():
    friction = effect("coulomb_friction")
    once = friction.with_fixed({"asymmetry_deg_per_s2": 0.3, "friction_deg_per_s2": 2.0})
    twice = friction.with_fixed({"asymmetry_deg_per_s2": 0.3}).with_fixed({"friction_deg_per_s2": 2.0})
    assert once == twice
    np.testing.assert_array_equal(twice.complete(np.array([0.5, 0.1])), [2.0, 0.3, 0.5, 0.1])
