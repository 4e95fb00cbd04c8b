"""The commands as a user calls them: files, keys, exit statuses, one line for each thing that is wrong."""

from __future__ import annotations

import csv
import json
import re
import sys

import numpy as np
import pytest

from anglecam.cli.app import main
from anglecam.data.series import SERIES_COLUMNS as COLUMNS
from anglecam.data.series import AngleSeries
from anglecam.io.series_csv import write_series
from support import broken
from support.drawn import Look, Plant, Recording, draw_session
from support.series import session as make_records


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    """Two clips drawn by another program, of a plant that answers 40 ms late, and what is true of them."""
    folder = tmp_path_factory.mktemp("film")
    recordings = [
        Recording("a-steps", "steps", duration_s=3.0),
        Recording("b-random", "random", duration_s=3.0, held_out=True),
    ]
    drawn = {"plant": Plant(dead_time_s=0.04), "recordings": recordings, "seed": 5, "mouth": "declared"}
    truth = draw_session(folder, look=Look(marker="ring"), **drawn)
    return folder, truth


@pytest.fixture
def series_session(tmp_path):
    """Return a session of angle series, without a film."""
    folder = tmp_path / "session"
    folder.mkdir()
    for record in make_records(Plant(dead_time_s=0.04), 4):
        n = len(record.time)
        series = AngleSeries(record.name, record.time, record.angle, np.full(n, np.radians(0.05)), ("ok",) * n)
        write_series(series, folder / f"{record.name}.angles.csv")
        rows = np.column_stack([record.command.time, np.degrees(record.command.angle)])
        text = "\n".join(f"{t:.6f},{u:.6f}" for t, u in rows)
        (folder / f"{record.name}.command.csv").write_text(f"time_s,command_deg\n{text}\n")
    (folder / "rig.yaml").write_text("held_out: [random]\n")
    return folder


@pytest.fixture
def status(monkeypatch, capfd):
    """Return what calls a command without a process of its own: its exit status and what it says on standard error."""

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["anglecam", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        return ended.value.code, capfd.readouterr().err

    return call


@pytest.mark.sweep  # the commands go the whole way in `test_hidden_backlash` of `tests/test_tutorials.py`, too
def test_from_film_to_verdict(film, tmp_path, status):
    folder, truth = film
    assert status("close", folder, "--out", tmp_path) == (0, "")
    for name, true in truth.items():
        header, *rows = list(csv.reader((tmp_path / f"{name}.angles.csv").open()))
        assert tuple(header[: len(COLUMNS)]) == COLUMNS
        assert len(rows) == len(true.time_s)
        angle = np.array([float(row[2]) for row in rows])
        assert np.sqrt(np.mean((angle - true.angle_deg) ** 2)) < 0.1
    loop = json.loads((tmp_path / "loop.json").read_text())
    _every_key_of_the_contract(loop)
    assert loop["verdict"] == "attributed"
    assert [e["id"] for e in loop["effects"]] == ["dead_time"]
    assert loop["effects"][0]["parameters"]["tau_s"]["value"] == pytest.approx(0.040, abs=0.005)
    assert {name: value["value"] for name, value in loop["model"].items()} == pytest.approx(
        {"a_per_s": 26.0, "b_per_s2": 524.0, "c_per_s2": 508.0}, rel=0.05
    )
    assert loop["rmse_deg"]["after"]["held_out"] < 0.1 * loop["rmse_deg"]["before"]["held_out"]
    page = (tmp_path / "report.html").read_text()
    assert "dead_time" in page
    assert not re.search(r"""(src|href)=["']?(https?:)?//""", page)  # it opens without a network


def _every_key_of_the_contract(loop):
    assert loop.keys() >= {
        "verdict", "effects", "rmse_deg", "held_out_gain", "p_value", "model", "detectable", "candidates",
    }  # fmt: skip
    effect = loop["effects"][0]
    assert effect.keys() >= {"id", "parameters", "relaxes", "alias_set", "separating_experiment"}
    assert effect["parameters"]["tau_s"].keys() >= {"value", "sigma", "null"}
    assert loop["rmse_deg"].keys() == {"before", "after", "noise_floor"}
    assert loop["held_out_gain"].keys() == {"ratio", "interval_95"}
    assert loop["detectable"][0].keys() == {"id", "smallest", "unit"}
    assert loop["candidates"][0].keys() == {"id", "log_likelihood_gain", "held_out_rmse_deg"}


@pytest.mark.parametrize("estimator", ["ekf", "oe2", "oe3"])
def test_identify_writes_a_model(series_session, tmp_path, status, estimator):
    code, told = status("identify", series_session, "--estimator", estimator, "--out", tmp_path)
    assert code == 0, told
    model = json.loads((tmp_path / "model.json").read_text())
    assert model["estimator"] == estimator
    assert model.keys() >= {"parameters", "rmse_deg", "step"}
    assert all(p.keys() == {"value", "sigma"} for p in model["parameters"].values())
    assert model["rmse_deg"]["held_out"] > 0.0
    assert model["step"].keys() >= {"rise_time_s", "overshoot", "settling_time_s", "steady_state_deg"}
    assert model["step"]["steady_state_deg"] == pytest.approx(508 / 524, rel=0.02)


def test_bad_clips_cost_themselves_one_line_each_and_the_good_one_is_measured(film, tmp_path, status):
    good, _ = film
    clip = good / "a-steps.avi"
    folder = tmp_path / "clips"
    folder.mkdir()
    bad = [
        broken.empty_clip(folder),
        broken.text_clip(folder),
        broken.truncated_clip(folder, clip),
        broken.clip_of_an_empty_room(folder),
        broken.zero_frame_clip(folder),
        folder / "not_there.avi",
    ]
    code, told = status("measure", *bad, clip, "--rig", good / "rig.yaml", "--out", tmp_path / "out")
    assert code == 1
    lines = told.splitlines()
    assert len(lines) == len(bad), told
    for path in bad:
        assert sum(path.name in line for line in lines) == 1, told
    assert (tmp_path / "out" / "a-steps.angles.csv").exists()
    assert (tmp_path / "out" / "truncated.angles.csv").exists()  # what could be read is measured
    assert "Traceback" not in told


def test_a_bad_command_file_costs_its_recording_only(series_session, tmp_path, status):
    broken.command_backwards(series_session, "steps")
    code, told = status("identify", series_session, "--out", tmp_path)
    assert code == 1
    assert len(told.splitlines()) == 1
    assert "steps.command.csv" in told
    assert json.loads((tmp_path / "model.json").read_text())["parameters"]["b_per_s2"]["value"] > 0.0


@pytest.mark.parametrize("verb", ["measure", "identify", "close"])
def test_a_bad_rig_file_is_exit_status_2_and_one_line(series_session, film, tmp_path, status, verb):
    broken.rig_with_unknown_key(series_session)
    if verb == "measure":
        code, told = status(verb, film[0] / "a-steps.avi", "--rig", series_session / "rig.yaml", "--out", tmp_path)
    else:
        code, told = status(verb, series_session, "--out", tmp_path)
    assert code == 2
    assert len(told.splitlines()) == 1, told
    assert "rig.yaml" in told
    assert "unknown key" in told


def test_wrong_calls_are_exit_status_2(series_session, tmp_path, status):
    assert status("close", tmp_path / "nowhere", "--out", tmp_path / "o")[0] == 2
    assert status("close", series_session, "--hold-out", "nobody", "--out", tmp_path / "o")[0] == 2
    assert status("identify", series_session, "--estimator", "oe9", "--out", tmp_path / "o")[0] == 2
    assert status("measure", "--out", tmp_path / "o")[0] == 2
    assert status("nonsense")[0] == 2


def test_a_session_where_nothing_can_be_used_is_exit_status_1(tmp_path, status):
    broken.empty_clip(tmp_path)
    code, told = status("close", tmp_path, "--out", tmp_path / "out")
    assert code == 1
    assert "empty" in told
    assert "Traceback" not in told
