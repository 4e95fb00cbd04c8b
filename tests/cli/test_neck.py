"""`anglecam neck` as a user calls it: the paper's rows in the JSON, tables and figures, one line for what is wrong."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from anglecam.cli import app as cli
from anglecam.data.command import Command
from anglecam.data.record import Record
from anglecam.data.series import AngleSeries
from anglecam.io.files import write_json
from anglecam.io.neck_file import read_neck
from anglecam.io.series_csv import write_series
from anglecam.neck.correlated import UncertainValue
from anglecam.neck_design.systems import paper_systems, second_order, side_by_side
from anglecam.neck_design.text import with_sigma
from support.motion import Plant
from support.series import session

VERBS = ("kinematics", "statics", "response", "design", "pd", "sensitivity")
FIGURES = {
    "kinematics": {"linkage", "turning"},
    "statics": {"statics"},
    "response": {"step", "series"},
    "design": {"design"},
    "pd": {"pd"},
    "sensitivity": {"sensitivity"},
}


@pytest.fixture
def run(monkeypatch, capsys):
    """Call the command line in this process: exit status, standard output, standard error."""

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["anglecam", "neck", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        out, err = capsys.readouterr()
        return ended.value.code or 0, out, err

    return call


@pytest.fixture
def numbers(run):
    def call(*arguments):
        status, out, err = run(*arguments, "--json")
        assert (status, err) == (0, "")
        return json.loads(out)

    return call


@pytest.fixture
def model_file(tmp_path):
    """Return a model.json of SYS1 with correlated uncertainties."""
    names = ("a_per_s", "b_per_s2", "c_per_s2")
    covariance = np.array([[1.0, 8.0, 9.0], [8.0, 100.0, 110.0], [9.0, 110.0, 144.0]])
    values = (25.9786, 523.7292, 507.5597)
    sigmas = np.sqrt(np.diag(covariance))
    parameters = {n: {"value": v, "sigma": s} for n, v, s in zip(names, values, sigmas, strict=True)}
    path = tmp_path / "model.json"
    result = {"estimator": "oe2", "parameters": parameters, "covariance": {"names": names, "matrix": covariance}}
    write_json(path, result)
    return path


@pytest.mark.parametrize("verb", VERBS)
def test_each_verb_prints_tables_and_writes_numbers_and_figures(run, tmp_path, verb):
    status, out, err = run(verb, "--out", tmp_path / "made")
    assert (status, err) == (0, "")
    assert "━" in out
    json.loads((tmp_path / "made" / f"{verb}.json").read_text())
    pictures = sorted((tmp_path / "made").glob("*.png"))
    assert {p.stem for p in pictures} == FIGURES[verb]
    assert all(p.read_bytes().startswith(b"\x89PNG") for p in pictures)


def test_kinematics_has_table_3_and_the_line_of_fig_4(numbers):
    result = numbers("kinematics", "--angle", "10", "--angle", "-20")
    up, neutral, down = result["table_3"]
    assert [row["theta_f_deg"] for row in (down, neutral, up)] == pytest.approx([70.5, 46.8, 20.9], abs=0.05)
    assert [row["theta_s_deg"] for row in (up, neutral, down)] == pytest.approx([216.0, 135.0, 62.0])
    assert [row["theta_a_deg"] for row in (up, neutral, down)] == pytest.approx([81.0, 0.0, -73.0])
    assert [row["command"] for row in (up, neutral, down)] == [254, 127, 2]
    assert result["line"]["slope"] == pytest.approx(-0.357, abs=5e-4)
    assert result["line"]["intercept_deg"] == pytest.approx(95.2, abs=0.05)
    assert result["line"]["r_squared"] == pytest.approx(0.9937, abs=1e-4)
    assert result["bearing"]["torque_kgf_cm"] == pytest.approx(1.47e-3, abs=5e-6)
    for wanted, row in zip((10.0, -20.0), result["wanted"], strict=True):
        assert row["nod_deg"] == pytest.approx(wanted)
        assert abs(row["error_deg"]) < 0.5 * max(r["resolution_deg_per_count"] for r in result["table_3"])


def test_statics_balances_the_head(numbers):
    result = numbers("statics", "--pretension", "36")
    assert result["spring"]["stiffness_N_m"] == pytest.approx(5.318, abs=5e-4)
    assert result["neutral_deg"] == pytest.approx(0.0, abs=1e-9)
    assert result["film"]["damping_N_m_s"] == pytest.approx(0.0530, abs=5e-5)
    assert result["film"]["damping_of_SAE_20_N_m_s"] == pytest.approx(5.3e-5, abs=5e-8)
    assert result["servo"]["stall_torque_N_m"] == pytest.approx(0.475, abs=5e-4)
    # spring that is tighter by 0.37° turns the head back by about K·L2·L6 over the stiffness times that
    expected = -(result["pretension_angle_deg"] - 36.0) * 5.318 / result["stiffness_of_spring_and_weight_N_m"]
    assert result["wanted"]["neutral_deg"] == pytest.approx(expected, rel=0.01)


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


def test_an_uncertainty_of_rounding_size_counts_as_exact():
    assert with_sigma(UncertainValue(6.0, 1e-14)) == "6"
    assert with_sigma(UncertainValue(6.0, 0.01)) == "6.000 ± 0.010"


def test_design_has_the_papers_constants_and_prints_contradictions(numbers, run):
    result = numbers("design")
    first, second, _ = result["routes"]
    assert first["found"]["torque_gain_N_m_per_V"]["value"] == pytest.approx(2.944, abs=5e-4)
    assert first["found"]["sensor_gain_V_per_rad"]["value"] == pytest.approx(1.393, abs=5e-4)
    assert first["found"]["sensor_gain_bound_V_per_rad"]["value"] == pytest.approx(4.259, abs=5e-4)
    assert first["found"]["back_emf_ratio_V_s_per_rad"]["value"] == pytest.approx(-0.092, abs=5e-4)
    assert second["found"]["damping_N_m_s"]["value"] == pytest.approx(0.152, abs=5e-4)
    assert "cannot be negative" in first["contradictions"][0]
    assert second["contradictions"] == []
    assert result["step"]["overshoot_percent"] == pytest.approx(11.5, abs=0.05)
    assert result["explained_neck"]["C"]["value"] == pytest.approx(0.152, abs=5e-4)
    assert "c4 = −0.0922 V·s/rad cannot be negative" in run("design")[1]


def test_design_carries_a_models_correlations(numbers, model_file):
    result = numbers("design", "--model", model_file)
    h = result["routes"][0]["found"]["sensor_gain_V_per_rad"]
    a, b, c = 25.9786, 523.7292, 507.5597
    passive = 5.31793 - 0.80431
    slope = np.array([0.0, 1.0 / c, -b / c**2 + passive / (0.0058 * c**2)]) / -0.36
    covariance = np.array([[1.0, 8.0, 9.0], [8.0, 100.0, 110.0], [9.0, 110.0, 144.0]])
    assert h["sigma"] == pytest.approx(np.sqrt(slope @ covariance @ slope), rel=1e-4)
    independent = numbers("design", "--a", a, "--b", b, "--c", c, "--sigma", 1, 10, 12)
    other = independent["routes"][0]["found"]["sensor_gain_V_per_rad"]["sigma"]
    assert other == pytest.approx(np.sqrt(slope**2 @ np.diag(covariance)), rel=1e-4)
    assert abs(other - h["sigma"]) > 0.01 * other


def test_a_command_gain_takes_c_per_volt(numbers, tmp_path):
    (tmp_path / "neck.yaml").write_text("servo: {command_gain_V_per_rad: 2.0}\n")
    result = numbers("design", "--neck", tmp_path / "neck.yaml")
    assert result["identified"]["c_rad_per_s2_V"]["value"] == pytest.approx(507.5597 / 2.0)
    models = {m["name"]: m for m in numbers("response", "--neck", tmp_path / "neck.yaml")["models"]}
    assert models["small angles"]["gain"] == pytest.approx(2.0 * 0.964, abs=2e-3)


def test_a_wish_makes_a_neck(numbers, tmp_path, run):
    made = numbers("design", "--wish-rise", "0.3", "--wish-overshoot", "0", "--free", "K,h,K_d")["synthesis"]
    assert made["feasible"]
    assert made["step"]["rise_time_s"] == pytest.approx(0.3, rel=0.021)
    assert set(made["changes"]) == {"K", "h", "K_d"}
    assert {"name", "value", "limit", "unit", "sense", "met", "active"} <= made["constraints"][0].keys()
    status, out, _ = run("design", "--wish-rise", "0.3", "--wish-up", "40", "--free", "h,K_d", "--out", tmp_path)
    assert status == 0
    assert "range upward ≥ 40 °" in out
    assert "(nearest found: 31.13 °)" in out
    assert "servo torque at the end (shaft)" in out
    assert "overshoot ≤ 0.5 %" in out
    changes = numbers("design", "--wish-rise", "0.3", "--free", "K,K_d")["synthesis"]["changes"]
    assert changes["K"]["before"] == 1877.8  # as declared, not what the motion gave back
    assert "cannot be met" in out
    assert (tmp_path / "synthesis.png").exists()


def test_pd_is_fig_16_and_tunes_to_the_adult(numbers):
    result = numbers("pd", "--tune")
    loops = {(loop["proportional"], loop["derivative_s"]): loop for loop in result["loops"]}
    assert len(loops) == 16
    for K_d in (0.005, 0.01):
        assert loops[0.0, K_d]["overshoot_percent"] == 0.0
        assert loops[0.0, K_d]["steady_state_deg"] == pytest.approx(23.58, abs=5e-3)
    assert loops[0.01, 0.0]["loss_percent"] == pytest.approx(19.1, abs=0.05)
    assert loops[0.0, 0.0]["overshoot_percent"] == pytest.approx(10.04, abs=5e-3)
    assert result["tuned"]["feasible"]
    assert result["tuned"]["rise_time_s"] == pytest.approx(0.3, rel=0.021)
    assert result["tuned"]["overshoot_percent"] <= 0.5
    assert {"phase_margin_deg", "gain_margin_dB", "modulus_margin", "sensitivity"} <= result["tuned"].keys()


def test_pd_tunes_a_neck_like_a_measured_nod_and_tries_it_at_large_angles(numbers, tmp_path):
    nod = {"rise_time_s": {"value": 0.2, "sigma": 0.001}, "overshoot": {"value": 0.02, "sigma": 0.001}}
    write_json(tmp_path / "adult.responses.json", [nod])
    (tmp_path / "neck.yaml").write_text("linkage_slope: exact\nspring: {common_stretch_m: 0.03}\n")
    result = numbers("pd", "--neck", tmp_path / "neck.yaml", "--like", tmp_path / "adult.responses.json")
    assert result["tuned"]["wanted"] == {"rise_time_s": 0.2, "overshoot": 0.02, "overshoot_percent": 2.0}
    assert result["tuned"]["rise_time_s"] == pytest.approx(0.2, rel=0.021)
    assert result["large_angles"]["rise_time_s"] == pytest.approx(0.2, rel=0.5)
    assert 10.0 < result["large_angles"]["steady_state_deg"] < 30.0


def test_default_gains_of_a_fitted_model_lose_as_much_as_those_of_fig_16(numbers, model_file):
    result = numbers("pd", "--model", model_file)
    largest = max(loop["proportional"] for loop in result["loops"])
    lost = next(loop for loop in result["loops"] if loop["proportional"] == largest and loop["derivative_s"] == 0.0)
    assert lost["loss_percent"] == pytest.approx(19.1, abs=0.05)  # the same K_p·G(0)


def test_sensitivity_has_a_row_for_each_quantity_and_five_panels(numbers):
    result = numbers("sensitivity")
    rows = {row["symbol"]: row for row in result["sensitivities"]}
    assert rows["C"]["steady_state_percent_per_percent"] == pytest.approx(0.0, abs=1e-6)
    # a gain c3/(c3·h·γ + passive) grows with h as −h·γ·c3 over the stiffness
    assert rows["h"]["steady_state_percent_per_percent"] == pytest.approx(0.486, abs=1e-3)
    assert [panel["symbol"] for panel in result["figure_9"]] == ["h", "K_m", "G_a", "R_a", "L_6"]
    unstable = [c for c in result["figure_9"][2]["curves"] if not c["stable"]]
    assert [(c["value"], c["rise_time_s"]) for c in unstable] == [(1000.0, None)]


def test_power_of_a_made_log_is_the_true_power(numbers, run, tmp_path):
    time = np.arange(0.0, 4.0, 0.005)
    current = np.where((time >= 1.0) & (time <= 2.0), 0.6, 0.0)
    log = tmp_path / "log.csv"
    table = np.column_stack([time, 6.0 - 2.5 / 0.6 * current, current])
    np.savetxt(log, table, delimiter=",", header="time_s,voltage_v,current_a", comments="")
    result = numbers("power", log, "--nod", "1.0:2.0")
    assert result["nods"][0]["mean_power_W"] == pytest.approx(2.1, rel=1e-6)
    assert result["all_servos_W"] == pytest.approx(33.6, rel=1e-6)
    assert result["source"]["resistance_ohm"]["value"] == pytest.approx(4.1667, abs=1e-4)
    status, out, err = run("power", log, "--out", tmp_path / "out")
    assert (status, err) == (0, "")
    assert "33." in out
    assert (tmp_path / "out" / "power.png").exists()


WRONG_CALLS = [
    (("kinematics", "--angle", "40"), "a nod of 40.00° is beyond the neck's"),
    (("design", "--a", "26"), "give all of --a, --b and --c"),
    (("design", "--a", "26", "--b", "524", "--c", "-3"), "c = -3 rad/(s²·V) is not positive"),
    (("design", "--wish-rise", "-1"), "cannot be wanted"),
    (("design", "--wish-rise", "0.3", "--free", "Q"), "Q cannot be free"),
    (("response", "--step", "0"), "a step has a height"),
    (("kinematics", "--angle", "nan"), "not a number"),
    (("pd", "--kp", "nan"), "a gain is a finite number"),
    (("kinematics", "--neck", "nowhere.yaml"), "nowhere.yaml: cannot be read"),
]


@pytest.mark.parametrize(("arguments", "says"), WRONG_CALLS)
def test_a_wrong_call_is_one_line_and_exit_status_2(run, arguments, says):
    status, out, err = run(*arguments)
    assert (status, out) == (2, "")
    assert says in err
    assert len(err.splitlines()) == 1


def test_a_wrong_neck_file_is_one_line_that_names_it_and_exit_status_2(run, tmp_path):
    neck = tmp_path / "neck.yaml"
    neck.write_text("spring: {rate: 3}\n")
    for verb in VERBS:
        status, _, err = run(verb, "--neck", neck)
        assert (status, len(err.splitlines())) == (2, 1)
        assert "neck.yaml: unknown key spring.rate" in err
    neck.write_text("linkage: {coupler_m: 0.2}\n")
    status, _, err = run("kinematics", "--neck", neck)
    assert (status, len(err.splitlines())) == (2, 1)
    assert "neck.yaml: the four links cannot close" in err


def test_only_an_unstable_neck_lacks_step_figures(numbers, tmp_path):
    (tmp_path / "neck.yaml").write_text("servo: {sensor_gain_V_per_rad: 6}\n")
    models = {m["name"]: m for m in numbers("response", "--neck", tmp_path / "neck.yaml")["models"]}
    for name in ("small angles", "large angles"):
        assert models[name]["rise_time_s"] is None
    assert models["SYS2"]["overshoot_percent"] == pytest.approx(10.04, abs=5e-3)
    for verb in ("response", "statics"):
        assert "unstable, Eq. (35)" in numbers(verb, "--neck", tmp_path / "neck.yaml")["notes"][0]


def test_a_weak_and_a_saturated_servo_are_reported(numbers, run):
    result = numbers("statics")
    demand = result["demand"]
    assert demand["torque_at_shaft_N_m"] == pytest.approx(0.36 * 1.814, abs=1e-3)
    assert demand["stall_torque_N_m"] == pytest.approx(0.475, abs=5e-4)
    # Eq. (12): c3·e = T, and the motor has G_a·e
    assert demand["motor_voltage_V"] == pytest.approx(37.0 * 1.814 / 2.9304, rel=1e-3)
    assert "stall torque is exceeded" in result["notes"][0]
    assert "saturates" in result["notes"][1]
    assert "stall torque is exceeded" in run("design")[1]
    assert "asks 14.2 V of 6 V" in numbers("response")["notes"][0]
    assert numbers("response", "--step", "5")["notes"] == []


def test_gains_are_printed_with_units_and_meaning(numbers, run, model_file, tmp_path):
    result = numbers("pd")
    assert result["gain_units"] == {"proportional": "1/°", "derivative_s": "s/°"}
    assert "1 stands for a command of 22°, so K_p = 0.01 is 0.22°/°" in result["gains_of"]
    (tmp_path / "neck.yaml").write_text("damping_N_m_s: 0.15\n")
    assert "V·s/rad" in run("pd", "--neck", tmp_path / "neck.yaml")[1]
    assert "steady state, °/°" in " ".join(run("pd", "--model", model_file)[1].split())


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


def test_a_command_past_a_dead_centre_and_the_range_of_the_fitted_line_are_reported(numbers, run, tmp_path):
    assert numbers("kinematics")["notes"] == []
    (tmp_path / "neck.yaml").write_text("command: {down_deg_per_count: 0.7059}\n")
    (note,) = numbers("kinematics", "--neck", tmp_path / "neck.yaml")["notes"]
    assert "command 2 (down)" in note
    assert "dead centre" in note
    (tmp_path / "neck.yaml").write_text("linkage: {crank_m: 0.0155}\n")
    assert "over a nod of ±25°" in run("kinematics", "--neck", tmp_path / "neck.yaml")[1]


def test_json_has_no_rounding_errors_of_the_arithmetic(run):
    out = run("statics", "--json")[1]
    assert '"nod_deg": -15.0,' in out


def test_help_has_whole_lines(run):
    out = run("--help")[1]
    assert not any(line.rstrip().endswith(("Fig.", "Eq.", "Eqs.")) for line in out.splitlines())
    assert "list[float]" not in run("pd", "--help")[1]


def test_a_wrong_data_file_is_one_line_and_exit_status_1(run, tmp_path):
    bad = tmp_path / "bad.json"
    bad.write_text("{}")
    calls = [("response", "--model", bad), ("design", "--model", bad), ("pd", "--model", bad), ("pd", "--like", bad)]
    calls += [("power", tmp_path / "none.csv"), ("response", "--measured", tmp_path / "none.angles.csv")]
    for arguments in calls:
        status, out, err = run(*arguments)
        assert (status, out, len(err.splitlines())) == (1, "", 1), err
        assert Path(arguments[-1]).name in err


def test_design_refuses_a_third_order_model(run, tmp_path):
    names = ("d2_per_s", "d1_per_s2", "d0_per_s3", "n2_per_s", "n1_per_s2", "n0_per_s3")
    values = (25.5, 311.5, 1969.8, 2.0, 120.0, 2100.0)
    parameters = {n: {"value": v, "sigma": 0.1} for n, v in zip(names, values, strict=True)}
    write_json(tmp_path / "model.json", {"estimator": "oe3", "parameters": parameters})
    status, _, err = run("design", "--model", tmp_path / "model.json")
    assert status == 1
    assert "model of second order" in err
    assert run("response", "--model", tmp_path / "model.json")[0] == 0


def test_the_installed_command_knows_the_verbs():
    done = subprocess.run(
        [Path(sys.executable).parent / "anglecam", "neck", "--help"], capture_output=True, text=True, check=True
    )
    assert all(verb in done.stdout for verb in (*VERBS, "power"))
