"""The paper's step responses, and a fitted model beside a measurement."""

from __future__ import annotations

import numpy as np
import pytest

from anglecam.data.command import Command
from anglecam.data.record import Record
from anglecam.data.series import AngleSeries
from anglecam.io.files import write_json
from anglecam.io.neck_file import read_neck
from anglecam.io.series_csv import write_series
from anglecam.neck_design.systems import paper_systems, second_order, side_by_side
from support.motion import Plant
from support.series import session


def test_response_has_the_papers_overshoots(numbers):
    result = numbers("response")
    models = {m["name"]: m for m in result["models"]}
    assert models["SYS1"]["overshoot_percent"] == pytest.approx(11.5, abs=0.05)
    assert models["SYS1"]["rise_time_s"] == pytest.approx(0.078, abs=5e-4)
    assert models["SYS1"]["settling_time_s"] == pytest.approx(0.26, abs=5e-3)
    assert models["SYS1"]["gain"] == pytest.approx(0.969, abs=5e-4)
    assert models["SYS2"]["overshoot_percent"] == pytest.approx(10.04, abs=5e-3)
    assert models["SYS2"]["steady_state_deg"] == pytest.approx(23.58, abs=5e-3)
    assert models["SYS2"]["rise_time_s"] == pytest.approx(0.166, abs=5e-4)
    assert models["large angles"]["steady_state_deg"] > models["small angles"]["steady_state_deg"] + 2.0


def test_response_compares_a_fitted_model_with_a_measurement(numbers, run, model_file, tmp_path):
    record = session(Plant(), 4)[1]
    n = len(record.time)
    series = AngleSeries(record.name, record.time, record.angle, np.full(n, np.radians(0.05)), ("ok",) * n)
    write_series(series, tmp_path / "stairs.angles.csv")
    rows = "\n".join(f"{t},{np.degrees(u)}" for t, u in zip(record.command.time, record.command.angle, strict=True))
    (tmp_path / "stairs.command.csv").write_text(f"time_s,command_deg\n{rows}\n")
    arguments = ("response", "--model", model_file, "--measured", tmp_path / "stairs.angles.csv")
    models = {m["name"]: m for m in numbers(*arguments)["models"]}
    assert models["fitted"]["overshoot_percent"] == pytest.approx(11.5, abs=0.05)
    assert models["fitted"]["measured_rmse_deg"] == pytest.approx(0.05, abs=0.01)  # the noise that was put in
    assert models["SYS2"]["measured_rmse_deg"] > 0.5
    (tmp_path / "stairs.command.csv").unlink()
    status, out, err = run(*arguments, "--out", tmp_path / "out")
    assert (status, err) == (0, "")
    assert "measured" not in out
    assert (tmp_path / "out" / "step.png").exists()


def test_a_wrong_gain_shows_in_the_rms_error():
    rig, driven = np.arange(0.0, 4.0, 1 / 30), Command(np.array([0.0, 1.0]), np.radians([5.0, 25.0]))
    truth = second_order("truth", "", (26.0, 524.0, 524.0))
    zero = np.radians(7.0)  # of the camera: not declared
    angle = zero + truth.model.predict(truth.parameters, rig, driven, np.radians([5.0, 0.0]))
    record = Record("step", rig, angle, driven, False, np.full(len(rig), 1e-3))
    right, wrong = side_by_side([truth, second_order("wrong", "", (26.0, 524.0, 1.1 * 524.0))], record).rmse.values()
    assert right == pytest.approx(0.0, abs=1e-9)
    # from 5 to 25° it is off by 10 % of the command: 2.5° for three of four seconds, 0.5° before
    assert np.degrees(wrong) == pytest.approx(np.sqrt(0.75 * 2.5**2 + 0.25 * 0.5**2), rel=0.03)
    third = paper_systems(read_neck(None).large_angle)[2]
    runs = side_by_side([third], Record("still", rig, 0.0 * rig, Command(np.zeros(1), np.zeros(1)), False, angle))
    np.testing.assert_allclose(runs.angles[0], 0.0, atol=1e-12)


def test_only_an_unstable_neck_lacks_step_figures(numbers, tmp_path):
    (tmp_path / "neck.yaml").write_text("servo: {sensor_gain_V_per_rad: 6}\n")
    models = {m["name"]: m for m in numbers("response", "--neck", tmp_path / "neck.yaml")["models"]}
    for name in ("small angles", "large angles"):
        assert models[name]["rise_time_s"] is None
    assert models["SYS2"]["overshoot_percent"] == pytest.approx(10.04, abs=5e-3)
    for verb in ("response", "statics"):
        assert "unstable, Eq. (35)" in numbers(verb, "--neck", tmp_path / "neck.yaml")["notes"][0]


def test_a_large_angle_model_responds_as_at_neutral_and_is_refused_by_design(numbers, run, tmp_path):
    parameters = {"damping_nms": {"value": 0.15, "sigma": 0.01}, "torque_gain_nm_per_v": {"value": 2.9, "sigma": 0.1}}
    transfer = {"numerator": [507.5597], "denominator": [1.0, 25.9786, 523.7292]}
    path = tmp_path / "model.json"
    write_json(path, {"estimator": "neck", "parameters": parameters, "transfer_function": transfer})
    fitted = numbers("response", "--model", path)["models"][-1]
    assert (fitted["name"], fitted["equation"]) == ("fitted", "neck at neutral")
    assert fitted["overshoot_percent"] == pytest.approx(11.5, abs=0.05)
    status, _, err = run("design", "--model", path)
    assert (status, len(err.splitlines())) == (1, 1)
    assert "a model of the neck at large angles" in err
    assert run("pd", "--model", path)[0] == 0
