"""The command line, the Python API and the batch check a session by the same functions."""

from __future__ import annotations

import json

import numpy as np
import pytest

import anglecam
from anglecam.errors import InputError, RigError
from anglecam.io.session import read_session
from anglecam.workflow import session_results
from anglecam.workflow.session import loop_input, measure_session, require_recordings
from support.motion import Plant, Recording, command_rows, move

KINDS = ("stairs", "chirp")


@pytest.fixture
def session(tmp_path):
    rng = np.random.default_rng(3)
    for kind in KINDS:
        recording = Recording(kind, kind)
        rows = command_rows(recording, rng)
        time = np.arange(0.0, recording.duration_s, 1.0 / 30.0)
        angle = move(Plant(), recording, time, rows) + rng.normal(0.0, 0.05, len(time))
        np.savetxt(tmp_path / f"{kind}.command.csv", rows, "%.6f", ",", header="time_s,command_deg", comments="")
        columns = np.column_stack([time, angle])
        np.savetxt(tmp_path / f"{kind}.angles.csv", columns, "%.6f", ",", header="time_s,angle_deg", comments="")
    return tmp_path


def test_identify_in_python_with_every_recording_held_out_is_one_line(session):
    (session / "rig.yaml").write_text("held_out: [stairs, chirp]\n")
    with pytest.raises(RigError, match="every recording that can be used is held out; nothing is left to fit"):
        anglecam.identify(session)
    with pytest.raises(RigError, match="every recording that can be used is held out"):
        anglecam.close_loop(session)


def test_identify_in_python_takes_every_estimator_and_holds_out_by_name(session):
    model = anglecam.identify(session, "ekf", hold_out=["chirp"])
    assert [record.name for record in model.fitted] == ["stairs"]
    assert model.held_out is not None
    neck = anglecam.identify(session, "neck")
    assert neck.estimator == "neck"
    with pytest.raises(RigError, match="no estimator 'magic'"):
        anglecam.identify(session, "magic")


def test_a_loop_over_more_frames_than_can_be_tested_is_refused_before_the_work(session, monkeypatch):
    monkeypatch.setattr("anglecam.workflow.session.MOST_FRAMES", 479)
    says = "480 frames, and a loop can be closed over 479; give fewer or shorter recordings, or a lower rate"
    with pytest.raises(InputError, match=f"^{session}: {says}$"):
        anglecam.close_loop(session)


def test_a_recording_that_does_not_exist_cannot_be_held_out(session):
    with pytest.raises(RigError, match="hold out nobody: no such recording"):
        anglecam.close_loop(session, hold_out=["nobody"])
    opened = read_session(session)
    require_recordings(opened, KINDS)
    with pytest.raises(RigError, match="hold out nobody: no such recording"):
        require_recordings(opened, ["stairs", "nobody"])


def test_a_session_without_a_usable_recording_is_one_line(tmp_path):
    (tmp_path / "a.angles.csv").write_text("time_s,angle_deg\n" + "".join(f"{i / 30},0\n" for i in range(5)))
    with pytest.raises(InputError, match="no recording can be used"):
        anglecam.identify(tmp_path)


def test_the_loop_sees_the_series_themselves_where_no_film_was_measured(session):
    measured = measure_session(read_session(session))
    assert [series.name for series in measured.series] == sorted(KINDS)
    shown = loop_input(measured)
    assert not shown.differs
    assert shown.records == measured.records


def test_a_recording_with_few_measured_frames_is_not_fitted_unless_the_rig_accepts_it(session):
    path = session / "stairs.angles.csv"
    lines = path.read_text().splitlines()
    gone = [f"{line.split(',')[0]}," if i % 5 else line for i, line in enumerate(lines[1:])]
    path.write_text("\n".join([lines[0], *gone]) + "\n")
    measured = measure_session(read_session(session))
    assert [record.name for record in measured.records] == ["chirp"]
    assert len(measured.problems) == 1
    assert "stairs: no model is fitted to it: only" in str(measured.problems[0])
    (session / "rig.yaml").write_text("least_measured: 0.1\n")
    assert len(measure_session(read_session(session)).records) == 2


def test_a_part_beside_the_verdict_that_fails_is_missing_and_the_verdict_is_written(session, tmp_path, monkeypatch):
    def diverges(*_arguments, **_more):
        raise np.linalg.LinAlgError("SVD did not converge")

    out = tmp_path / "out"
    out.mkdir()
    (out / "ekf.json").write_text("{}")  # of an earlier run
    monkeypatch.setattr(session_results, "identify_records", diverges)
    monkeypatch.setattr(session_results, "next_experiment", diverges)
    measured = measure_session(read_session(session))
    stages = []
    closed = session_results.write_closed(measured, loop_input(measured), out, progress=stages.append)
    assert [stage.name for stage in stages] == [
        "fitting the base model",
        "testing the residual",
        "reaching the verdict",
        "looking for a torque of free form",
        "fitting the clocks",
        "fitting the model by extended Kalman filter",
        "fitting the model by output error",
        "designing the next experiment",
        "working out the smallest effects that would be seen",
        "writing the report",
    ]
    written = json.loads((out / "loop.json").read_text())
    assert written["verdict"] == closed.verdict.verdict == "nothing_missing"
    names = [line.split(":")[0] for line in written["missing"]]
    assert names == ["ekf.json", "model.json", "the next experiment"]
    assert all("SVD did not converge" in line for line in written["missing"])
    assert "SVD did not converge" in (out / "report.html").read_text()
    assert not (out / "ekf.json").exists()


def test_the_model_file_states_the_clock_of_every_recording(session):
    path = session / "chirp.command.csv"
    rows = np.loadtxt(path, delimiter=",", skiprows=1)
    rows[:, 0] -= 0.25
    np.savetxt(path, rows, "%.6f", ",", header="time_s,command_deg", comments="")
    out = session / "out"
    out.mkdir()
    model = session_results.write_identified(measure_session(read_session(session)), out)
    clock = json.loads((out / "model.json").read_text())["clock"]
    for name, offset in (("stairs", 0.0), ("chirp", 0.25)):
        assert abs(clock[name]["offset_s"]["value"] - offset) < 4.0 * clock[name]["offset_s"]["sigma"] < 0.01
        assert abs(clock[name]["drift_ppm"]["value"]) < 4.0 * clock[name]["drift_ppm"]["sigma"]
    assert clock["alias"]["effects"] == ["dead_time", "actuator_lag"]
    assert clock["alias"]["equal_offsets_p_value"] < 1e-3
    assert any("chirp: the motion comes 0.25" in doubt for doubt in model.doubts)
