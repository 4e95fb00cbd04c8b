"""Kinematics, statics and power of the paper's neck, and what they warn of."""

from __future__ import annotations

import numpy as np
import pytest


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


def test_a_command_past_a_dead_centre_and_the_range_of_the_fitted_line_are_reported(numbers, run, tmp_path):
    assert numbers("kinematics")["notes"] == []
    (tmp_path / "neck.yaml").write_text("command: {down_deg_per_count: 0.7059}\n")
    (note,) = numbers("kinematics", "--neck", tmp_path / "neck.yaml")["notes"]
    assert "command 2 (down)" in note
    assert "dead centre" in note
    (tmp_path / "neck.yaml").write_text("linkage: {crank_m: 0.0155}\n")
    assert "over a nod of ±25°" in run("kinematics", "--neck", tmp_path / "neck.yaml")[1]


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
