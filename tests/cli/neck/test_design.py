"""The paper's design constants, their uncertainties, a neck for a wish, and sensitivities."""

from __future__ import annotations

import numpy as np
import pytest

from anglecam.io.files import write_json


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


def test_design_refuses_a_third_order_model(run, tmp_path):
    names = ("d2_per_s", "d1_per_s2", "d0_per_s3", "n2_per_s", "n1_per_s2", "n0_per_s3")
    values = (25.5, 311.5, 1969.8, 2.0, 120.0, 2100.0)
    parameters = {n: {"value": v, "sigma": 0.1} for n, v in zip(names, values, strict=True)}
    write_json(tmp_path / "model.json", {"estimator": "oe3", "parameters": parameters})
    status, _, err = run("design", "--model", tmp_path / "model.json")
    assert status == 1
    assert "model of second order" in err
    assert run("response", "--model", tmp_path / "model.json")[0] == 0


def test_sensitivity_has_a_row_for_each_quantity_and_five_panels(numbers):
    result = numbers("sensitivity")
    rows = {row["symbol"]: row for row in result["sensitivities"]}
    assert rows["C"]["steady_state_percent_per_percent"] == pytest.approx(0.0, abs=1e-6)
    # a gain c3/(c3·h·γ + passive) grows with h as −h·γ·c3 over the stiffness
    assert rows["h"]["steady_state_percent_per_percent"] == pytest.approx(0.486, abs=1e-3)
    assert [panel["symbol"] for panel in result["figure_9"]] == ["h", "K_m", "G_a", "R_a", "L_6"]
    unstable = [c for c in result["figure_9"][2]["curves"] if not c["stable"]]
    assert [(c["value"], c["rise_time_s"]) for c in unstable] == [(1000.0, None)]
