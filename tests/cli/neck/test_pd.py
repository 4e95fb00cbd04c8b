"""The PD loops of Fig. 16, and gains tuned to a wanted nod."""

from __future__ import annotations

import pytest

from anglecam.io.files import write_json


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


def test_gains_are_printed_with_units_and_meaning(numbers, run, model_file, tmp_path):
    result = numbers("pd")
    assert result["gain_units"] == {"proportional": "1/°", "derivative_s": "s/°"}
    assert "1 stands for a command of 22°, so K_p = 0.01 is 0.22°/°" in result["gains_of"]
    (tmp_path / "neck.yaml").write_text("damping_N_m_s: 0.15\n")
    assert "V·s/rad" in run("pd", "--neck", tmp_path / "neck.yaml")[1]
    assert "steady state, °/°" in " ".join(run("pd", "--model", model_file)[1].split())
