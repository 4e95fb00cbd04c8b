"""A fitted model in other programs: the same poles, the same covariance, and a unit for each number."""

import json
import subprocess
import sys

import control
import numpy as np
import pytest
from scipy import io, signal

from anglecam.cli.app import main
from anglecam.data.command import Command
from anglecam.data.series import AngleSeries
from anglecam.errors import InputError
from anglecam.identification.export import (
    FittedModel,
    fitted_large_angle,
    fitted_model,
    model_as_dict,
    read_model,
    scipy_system,
    transfer_function,
    unit_of,
    write_mat,
)
from anglecam.identification.identify_records import identify_records
from anglecam.io.files import write_json
from anglecam.io.rig import Rig
from anglecam.io.series_csv import write_series
from anglecam.models.large_angle import LargeAngle
from anglecam.neck.large_angle import LargeAngleNeck
from support.motion import Plant
from support.series import session


@pytest.fixture(scope="module")
def identified():
    """Models of second and third order of one session."""
    records = session(Plant(), 4)
    return {name: identify_records(records, Rig(), name) for name in ("oe2", "oe3")}


def second_order(covariance):
    return FittedModel(
        "oe2",
        ("a_per_s", "b_per_s2", "c_per_s2"),
        np.array([26.0, 524.0, 508.0]),
        np.array(covariance),
        np.array([508.0]),
        np.array([1.0, 26.0, 524.0]),
    )


@pytest.mark.parametrize("estimator", ["oe2", "oe3"])
def test_poles_are_equal_in_every_form(identified, estimator, tmp_path):
    model = fitted_model(identified[estimator])
    poles = np.sort_complex(model.poles)
    values = identified[estimator].values
    below = values[:2] if estimator == "oe2" else values[:3]
    np.testing.assert_array_equal(model.denominator, [1.0, *below])
    np.testing.assert_allclose(np.sort_complex(transfer_function(model).poles()), poles, rtol=1e-9)
    np.testing.assert_allclose(np.sort_complex(scipy_system(model).poles), poles, rtol=1e-9)
    write_mat(model, tmp_path / "model.mat")
    told = io.loadmat(tmp_path / "model.mat", squeeze_me=True, struct_as_record=False)["model"]
    np.testing.assert_array_equal(told.num, model.numerator if len(model.numerator) > 1 else model.numerator[0])
    np.testing.assert_array_equal(told.den, model.denominator)
    np.testing.assert_allclose(np.sort_complex(told.poles_per_s), poles, rtol=1e-12)


def test_the_gain_at_rest_and_the_step_response_are_the_models(identified):
    found = identified["oe2"]
    _, angle = signal.step(scipy_system(fitted_model(found)), T=np.linspace(0.0, 2.0, 4001))
    assert angle[-1] == pytest.approx(found.step.steady_state, rel=1e-6)
    assert angle.max() / found.step.steady_state - 1.0 == pytest.approx(found.step.overshoot, abs=1e-3)
    assert control.dcgain(transfer_function(fitted_model(found))) == pytest.approx(found.step.steady_state)


def test_the_mat_file_is_a_struct_with_names_units_and_covariance(tmp_path):
    covariance = [[0.01, 0.02, 0.03], [0.02, 0.5, 0.4], [0.03, 0.4, 0.6]]
    write_mat(second_order(covariance), tmp_path / "m.mat")
    told = io.loadmat(tmp_path / "m.mat")["model"]
    assert told.shape == (1, 1)
    struct = told[0, 0]
    assert [str(cell[0]) for cell in struct["names"][:, 0]] == ["a_per_s", "b_per_s2", "c_per_s2"]
    assert [str(cell[0]) for cell in struct["units"][:, 0]] == ["1/s", "1/s^2", "1/s^2"]
    np.testing.assert_array_equal(struct["covariance"], covariance)
    np.testing.assert_array_equal(struct["values"][:, 0], [26.0, 524.0, 508.0])
    assert struct["num"].shape == (1, 1)  # rows, as MATLAB's tf expects
    assert struct["den"].shape == (1, 3)
    assert [str(struct[key][0]) for key in ("input_unit", "output_unit")] == ["deg", "deg"]


def test_the_mat_file_depends_on_the_model_alone(tmp_path, monkeypatch):
    model = second_order([[1.0, 0.1, 0.0], [0.1, 4.0, 0.2], [0.0, 0.2, 9.0]])
    write_mat(model, tmp_path / "now.mat")
    monkeypatch.setattr("time.asctime", lambda *_: "Thu Jan  1 00:00:00 1970")
    write_mat(model, tmp_path / "then.mat")
    assert (tmp_path / "now.mat").read_bytes() == (tmp_path / "then.mat").read_bytes()


@pytest.mark.parametrize("estimator", ["oe2", "oe3"])
def test_model_json_keeps_the_covariance(identified, estimator, tmp_path):
    found = identified[estimator]
    write_json(tmp_path / "model.json", found.as_dict())
    read = read_model(tmp_path / "model.json")
    assert read.names == found.names
    np.testing.assert_allclose(read.values, found.values, rtol=1e-15)
    np.testing.assert_allclose(read.covariance, found.covariance, rtol=1e-15)
    np.testing.assert_allclose(read.sigmas, found.sigmas, rtol=1e-12)
    np.testing.assert_allclose(read.poles, fitted_model(found).poles, rtol=1e-12)
    assert np.linalg.eigvalsh(found.covariance / np.outer(found.sigmas, found.sigmas)).min() > 0.0


def test_a_model_without_covariance_gives_its_standard_uncertainties(tmp_path):
    parameters = {"a_per_s": {"value": 26.0, "sigma": 0.1}, "b_per_s2": {"value": 524.0, "sigma": 2.0}}
    parameters["c_per_s2"] = {"value": None, "sigma": None}
    write_json(tmp_path / "old.json", {"estimator": "oe2", "parameters": parameters})
    read = read_model(tmp_path / "old.json")
    assert read.names == ("a_per_s", "b_per_s2")
    np.testing.assert_allclose(read.covariance, np.diag([0.01, 4.0]))
    with pytest.raises(ValueError, match="nothing was commanded"):
        transfer_function(read)
    write_mat(read, tmp_path / "free.mat")
    assert io.loadmat(tmp_path / "free.mat")["model"][0, 0]["num"].size == 0


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"parameters": {"a_per_s": 3}}', '{"parameters": {}}', "not JSON"])
def test_a_file_that_is_no_model_is_reported_in_one_line(tmp_path, text):
    (tmp_path / "bad.json").write_text(text)
    with pytest.raises(InputError, match=r"bad.json: not a model.json"):
        read_model(tmp_path / "bad.json")


def test_a_large_angle_model_is_exported_as_its_linearisation_at_neutral():
    model = LargeAngle(LargeAngleNeck(gamma="exact", common_stretch=0.03))
    covariance = np.diag([1e-6, 1e-4, 1e-3, 25.0])
    out = fitted_large_angle(model, model.nominal, covariance)
    assert out.names == model.free
    np.testing.assert_array_equal(out.values, model.nominal)
    np.testing.assert_allclose(out.sigmas, [1e-3, 1e-2, np.sqrt(1e-3), 5.0])
    time, height = np.linspace(0.0, 0.6, 301), 1e-5
    small = model.predict(model.nominal, time, Command(np.zeros(1), np.array([height])), np.zeros(2)) / height
    np.testing.assert_allclose(small, signal.step(scipy_system(out), T=time)[1], atol=1e-4)
    told = model_as_dict(out)
    assert told["parameters"]["damping_nms"]["unit"] == "N*m*s"
    assert told["parameters"]["torque_gain_nm_per_v"]["unit"] == "N*m/V"
    assert set(told["transfer_function"]) >= {"numerator", "denominator", "input", "output"}


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("sensor_gain_v_per_rad", "V/rad"),
        ("spring_rate_n_per_m", "N/m"),
        ("neutral_deg", "deg"),
        ("common_stretch_m", "m"),
        ("n0_per_s3", "1/s^3"),
        ("tau_s", "s"),
    ],
)
def test_units_are_parsed_from_names(name, unit):
    assert unit_of(name) == unit


def test_loading_the_exports_does_not_load_python_control():
    modules = "anglecam.cli.app, anglecam.identification.export"
    code = f"import sys, {modules}, json; print(json.dumps('control' in sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) is False


def test_identify_writes_the_model_for_matlab_and_as_json(tmp_path, monkeypatch):
    for record in session(Plant(), 4)[:2]:
        series = AngleSeries(
            record.name, record.time, record.angle, np.full(len(record.time), np.nan), ("ok",) * len(record.time)
        )
        write_series(series, tmp_path / f"{record.name}.angles.csv")
        rows = "\n".join(f"{t},{np.degrees(u)}" for t, u in zip(record.command.time, record.command.angle, strict=True))
        (tmp_path / f"{record.name}.command.csv").write_text(f"time_s,command_deg\n{rows}\n")
    monkeypatch.setattr(sys, "argv", ["anglecam", "identify", str(tmp_path), "--out", str(tmp_path / "out")])
    with pytest.raises(SystemExit) as ended:
        main()
    assert not ended.value.code
    told = json.loads((tmp_path / "out" / "model.json").read_text())
    struct = io.loadmat(tmp_path / "out" / "model.mat")["model"][0, 0]
    np.testing.assert_array_equal(struct["covariance"], told["covariance"]["matrix"])
    np.testing.assert_array_equal(struct["den"][0], told["transfer_function"]["denominator"])
    np.testing.assert_array_equal(struct["num"][0], told["transfer_function"]["numerator"])
