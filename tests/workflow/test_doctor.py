"""`anglecam doctor`: the self-test agrees with its truth, and each fault of a machine is one line and status 1."""

from __future__ import annotations

import json
import sys
from collections import namedtuple
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from anglecam.cli.app import main
from anglecam.errors import InputError
from anglecam.workflow import doctor
from anglecam.workflow.self_test import FRAMES, SelfTest, self_test


@pytest.fixture(scope="module")
def result() -> SelfTest:
    return self_test()


def test_the_self_tests_error_is_what_its_uncertainty_states(result):
    assert (result.frames, result.measured) == (FRAMES, FRAMES)
    assert result.rms_error < np.radians(0.006)
    assert 0.5 < result.rms_error / result.rms_sigma < 1.5


def test_a_sound_machine_passes_and_says_so_in_json(result, monkeypatch, capsys):
    monkeypatch.setattr(doctor, "self_test", lambda: result)
    monkeypatch.setattr(doctor, "LEAST_MEMORY", 0)
    monkeypatch.setattr(sys, "argv", ["anglecam", "doctor", "--json"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 0
    document = json.loads(capsys.readouterr().out)
    assert document["problems"] == []
    figures = {check["name"]: check["figures"] for check in document["checks"]}
    assert all(figures["codecs"][name] for name in ("ffv1", "mjpeg", "h264"))
    assert figures["self-test"]["measured"] == FRAMES
    assert figures["versions"]["numpy"] == np.__version__


def test_problems_are_one_line_each_and_status_1(result, monkeypatch, capsys):
    monkeypatch.setattr(doctor, "self_test", lambda: result)
    monkeypatch.setattr(doctor, "_decodes", lambda codec: codec != "h264")
    monkeypatch.setattr(doctor, "_can_write", lambda folder: False)
    monkeypatch.setattr(doctor, "free_memory", lambda: 2**28)
    usage = namedtuple("usage", "free")
    monkeypatch.setattr(doctor.shutil, "disk_usage", lambda folder: usage(2**20))
    monkeypatch.setattr(sys, "argv", ["anglecam", "doctor"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 1
    lines = capsys.readouterr().err.splitlines()
    assert [line.split(":")[0] for line in lines] == ["codecs", "kernel cache", "memory", "disk"]


@pytest.mark.parametrize(
    ("changes", "says"),
    [({"measured": 12}, "12 of 30 frames"), ({"rms_error": 0.01}, "wrong by 0.57°"), ({"rms_error": np.nan}, "wrong")],
)
def test_a_wrong_self_test_is_a_problem(result, monkeypatch, changes, says):
    monkeypatch.setattr(doctor, "self_test", lambda: replace(result, **changes))
    assert says in doctor.check_self_test().problem


def test_a_self_test_that_fails_is_a_problem(monkeypatch):
    def fail() -> None:
        raise InputError("self-test.mkv: no mark found")

    monkeypatch.setattr(doctor, "self_test", fail)
    assert doctor.check_self_test().problem == "self-test: self-test.mkv: no mark found"


def test_a_folder_that_cannot_be_written_to_is_noticed(tmp_path: Path):
    (tmp_path / "file").touch()
    assert doctor._can_write(tmp_path / "new")
    assert not doctor._can_write(tmp_path / "file" / "below")
