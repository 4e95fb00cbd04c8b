"""A command is held from row to row, or its rows are samples with straight lines between them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from anglecam.data.camera_evidence import UNKNOWN_VIEW
from anglecam.data.command import Command
from anglecam.data.record import Record
from anglecam.errors import RigError
from anglecam.identification.output_error import fit_output_error
from anglecam.io.session import read_session
from anglecam.loop.stepwise import applicable
from anglecam.models.plant import Plant
from anglecam.models.third_order import ThirdOrder
from anglecam.workflow.session import measure_session

A, B, C = 5.0, 200.0, 180.0
STEPS = Command(np.array([0.0, 1.0, 3.0]), np.array([0.0, 0.0, 0.4]))


def test_straight_lines_go_through_the_rows_and_stay_level_outside():
    lines = STEPS.sampled()
    assert lines.at(np.array([-1.0, 0.5, 1.5, 2.0, 3.0, 9.0])) == pytest.approx([0.0, 0.0, 0.1, 0.2, 0.4, 0.4])
    assert STEPS.first_change() == 3.0
    assert lines.first_change() == 1.0
    assert Command(np.arange(3.0), np.ones(3)).sampled().first_change() is None


def test_steps_in_place_of_lines_have_the_mean_of_every_line():
    held = STEPS.sampled().held()
    assert held.slope is None
    assert STEPS.held() is STEPS
    spans = np.diff(held.time)
    inside = held.time[:-1] >= 1.0
    assert np.sum(held.angle[:-1][inside] * spans[inside]) / 2.0 == pytest.approx(0.2)
    assert held.at(np.array([9.0])) == pytest.approx([0.4])


def _moved():
    """Return frame times and angles of a plant that follows a continuous sine, by another integrator."""
    time = np.arange(0.0, 6.0, 1.0 / 50.0)

    def motion(t, state):
        return [state[1], C * _demand(t) - A * state[1] - B * state[0]]

    exact = solve_ivp(motion, (0.0, 6.0), [0.0, 0.0], t_eval=time, rtol=1e-10, atol=1e-12)
    return time, exact.y[0]


def _demand(t):
    return 0.2 * np.sin(2.0 * np.pi * 0.7 * np.maximum(t - 0.5, 0.0))


@pytest.mark.parametrize(("model", "tolerance"), [(Plant(), 2e-3), (ThirdOrder(), 2e-3)])
def test_a_sampled_signal_is_followed_without_half_a_sample_of_delay(model, tolerance):
    time, angle = _moved()
    rows = np.arange(0.0, 6.0, 0.05)
    held = Command(rows, _demand(rows))
    if isinstance(model, Plant):
        parameters, still = np.array([A, B, C]), np.zeros(2)
    else:  # (s + 60)·(s² + A·s + B), with a numerator that cancels the added pole
        parameters, still = np.array([A + 60.0, B + 60.0 * A, 60.0 * B, 0.0, C, 60.0 * C]), np.zeros(3)
    wrong = model.predict(parameters, time, held, still)
    right = model.predict(parameters, time, held.sampled(), still)
    assert np.max(np.abs(right - angle)) < tolerance
    assert np.max(np.abs(wrong - angle)) > 10.0 * np.max(np.abs(right - angle))


def test_a_sampled_signal_gives_the_parameters_of_the_plant():
    time, angle = _moved()
    rows = np.arange(0.0, 6.0, 0.05)
    command = Command(rows, _demand(rows)).sampled()
    measured = Record("sine", time, angle, command, zero_known=True, sigma=np.full(len(time), 1e-4))
    found = fit_output_error(Plant(), [measured], [np.array([8.0, 150.0, 150.0])]).parameters
    assert found == pytest.approx([A, B, C], rel=0.02)


@pytest.fixture
def session(tmp_path):
    time, angle = _moved()
    rows = np.arange(0.0, 6.0, 0.05)
    for name, at, values in (("sine.angles", time, angle), ("sine.command", rows, _demand(rows))):
        unit = "angle_deg" if name.endswith("angles") else "command_deg"
        columns = np.column_stack([at, np.degrees(values)])
        np.savetxt(tmp_path / f"{name}.csv", columns, "%.9f", ",", header=f"time_s,{unit}", comments="")
    return tmp_path


def test_the_rig_file_states_what_the_rows_mean(session):
    assert measure_session(read_session(session)).records[0].command.slope is None
    (session / "rig.yaml").write_text("command: {hold: linear}\n")
    assert measure_session(read_session(session)).records[0].command.slope is not None


def test_where_no_camera_was_no_effect_of_its_picture_is_offered(session):
    optical = {"camera_tilt", "pivot_offset", "lens_distortion", "rolling_shutter"}
    (session / "rig.yaml").write_text("source: encoder\n")
    (encoder,) = measure_session(read_session(session)).records
    assert encoder.view == UNKNOWN_VIEW
    assert not optical & {e.id for e in applicable([encoder])}
    (session / "sine.angles.csv").rename(session / "sine.avi")
    with pytest.raises(RigError, match="source: encoder"):
        read_session(session)


def test_a_command_whose_only_change_is_its_last_row_has_no_cycle():
    assert Command(np.arange(3.0), np.array([0.0, 0.0, 1.0])).cycle is None
