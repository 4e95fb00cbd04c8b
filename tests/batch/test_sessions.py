"""Folders with commands are sessions: the batch fits them as `identify` and `close` do."""

from __future__ import annotations

import csv
import json
import shutil

import fsspec
import pytest

from anglecam.batch.run import Options
from anglecam.batch.session_job import SessionJob, _inputs
from anglecam.batch.worker import Settings
from anglecam.io.session import read_session
from anglecam.workflow.session import measure_session
from anglecam.workflow.session_results import write_identified
from support.measured_here import run_batch
from support.tiny import tiny_clip, tiny_lab
from support.tiny_session import tiny_session

QUIET = Options(jobs=2, quiet=True)


@pytest.fixture
def lab(made_once, tmp_path):
    """Return a copy of the lab that a test may change."""
    return shutil.copytree(made_once, tmp_path / "lab")


@pytest.fixture(scope="module")
def made_once(tmp_path_factory):
    """Return a folder with one session of three series and a clip, and with a folder that is no session."""
    folder = tmp_path_factory.mktemp("made")
    tiny_clip(folder / "plain" / "a.avi")
    tiny_session(folder / "neck", 1, kinds=("stairs", "chirp", "random"))
    return folder


def test_a_session_is_identified_as_by_identify_and_again_only_after_a_change(lab, tmp_path):
    out = tmp_path / "out"
    result = run_batch([str(lab)], out, QUIET)
    found = [str(problem) for problem in result.problems]
    opened = read_session(lab / "neck")
    measured = measure_session(opened)
    write_identified(measured, tmp_path / "alone")
    model = (out / "neck" / "model.json").read_bytes()
    assert model == (tmp_path / "alone" / "model.json").read_bytes()
    assert [row.model for row in result.rows] == ["neck/model.json", None]
    assert found == [f"{lab}/neck: {problem}" for problem in measured.problems]
    written = (out / "neck" / "model.json").stat().st_mtime_ns
    assert run_batch([str(lab)], out, QUIET).rows == result.rows
    assert (out / "neck" / "model.json").stat().st_mtime_ns == written
    (lab / "neck" / "rig.yaml").write_text("held_out: [chirp]\n")
    run_batch([str(lab)], out, QUIET)
    assert (out / "neck" / "model.json").read_bytes() != model


def test_close_closes_the_loop_and_the_index_states_the_verdict(lab, tmp_path):
    out = tmp_path / "out"
    run_batch([str(lab)], out, Options(jobs=2, quiet=True, close=True))
    loop = json.loads((out / "neck" / "loop.json").read_text())
    assert loop["verdict"] == "attributed"
    assert [effect["id"] for effect in loop["effects"]] == ["dead_time"]
    assert (out / "neck" / "report.html").exists()
    rows = list(csv.DictReader((out / "index.csv").open()))
    found = [(row["verdict"], row["effects"], row["model"]) for row in rows]
    assert found == [("attributed", "dead_time", "neck/model.json"), ("", "", "")]
    # a later batch without --close keeps the verdict
    again = run_batch([str(lab)], out, QUIET)
    assert (out / "neck" / "report.html").exists()
    assert again.rows[0].verdict == "attributed"


def test_a_session_that_cannot_be_fitted_is_reported_once_and_its_clips_are_measured(tmp_path):
    folder = tiny_lab(tmp_path / "lab", ["a.avi", "b.avi"])
    (folder / "a.command.csv").write_text("time_s,command_deg\n0,0\n0.1,5\n")
    (folder / "rig.yaml").write_text("held_out: [a, b]\n")
    fsspec.filesystem("memory").put(str(folder), "/unfit", recursive=True)
    for address, out in ((str(folder), tmp_path / "here"), ("memory://unfit", tmp_path / "there")):
        result = run_batch([address], out, QUIET)
        assert [row.status for row in result.rows] == ["ok", "ok"]
        assert result.rows[0].cause.startswith("no model: ")
        assert len([p for p in result.problems if str(p).startswith(f"{address}: ")]) == len(result.problems)
        assert "/unfinished/" not in str(result.problems)
        assert (out / "a.angles.csv").exists()


def test_a_session_none_of_whose_clips_can_be_measured_adds_no_problem_of_its_own(tmp_path):
    lab = tmp_path / "lab"
    tiny_clip(lab / "a.avi").write_bytes(b"")
    (lab / "a.command.csv").write_text("time_s,command_deg\n0,0\n0.1,5\n")
    result = run_batch([str(lab)], tmp_path / "out", QUIET)
    assert [str(p) for p in result.problems] == [f"{lab}/a.avi: empty file"]


def test_a_session_depends_on_tracks_that_replace_a_clip(tmp_path):
    job, settings = SessionJob(str(tmp_path), "", (), close=False), Settings(out=str(tmp_path / "out"), run="one")
    tracks = tmp_path / "nodDLC_resnet50_headshuffle1_500.csv"
    found = []
    for x in (10.0, 11.0):
        tracks.write_text(f"scorer,a,a,a\nbodyparts,nose,nose,nose\ncoords,x,y,likelihood\n0,{x},20.0,0.9\n")
        found.append(_inputs(job, settings))
    assert found[0] != found[1]
