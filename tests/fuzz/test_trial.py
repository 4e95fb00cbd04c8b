"""The judge of damaged files can fail: whatever is not a result or a good line is seen, a death and a hang too."""

from __future__ import annotations

import os
import signal
import time
import warnings
from pathlib import Path

import pytest

from anglecam.errors import InputError
from benchmarks.fuzz.trial import DIED, FINDING, REFUSED, RESULT, Outcome, Trial, judge


def _says(line: str):
    def read(path: Path) -> None:
        raise InputError(line.format(path=path))

    return read


def _warns(path: Path) -> None:
    warnings.warn("odd", RuntimeWarning, stacklevel=1)


def _dies(path: Path) -> None:
    os.kill(os.getpid(), signal.SIGSEGV)


def _hangs(path: Path) -> None:
    time.sleep(600)


def _bad_readers():
    return {"dies": _dies, "hangs": _hangs, "hoards": lambda path: len(bytearray(b"x") * (200 * 2**20)), "fine": str}


@pytest.mark.parametrize(
    ("read", "kind"),
    [
        (lambda path: None, RESULT),
        (_says("{path}: no mouth found"), REFUSED),
        (_says("no mouth found"), FINDING),
        (_says("{path}: "), FINDING),
        (_says("{path}: internal error, please report it (KeyError)"), FINDING),
        (lambda path: {}["key"], FINDING),
        (_warns, FINDING),
    ],
)
def test_the_judge_takes_nothing_but_a_result_or_a_line_with_file_and_cause(tmp_path, read, kind):
    assert judge(read, tmp_path / "clip.avi").kind == kind


def test_deaths_and_hoards_are_seen_from_outside_and_the_next_case_goes_on(tmp_path):
    trial = Trial(_bad_readers, seconds=60.0, most_bytes=100 * 2**20)
    try:
        assert trial.run("dies", tmp_path / "a") == Outcome(DIED, "SIGSEGV")
        assert "MiB of memory" in trial.run("hoards", tmp_path / "a").said
        assert trial.run("fine", tmp_path / "a").kind == RESULT
    finally:
        trial.close()


def test_a_case_that_hangs_is_ended(tmp_path):
    trial = Trial(_bad_readers, seconds=1.0, most_bytes=100 * 2**20)
    try:
        assert "longer than 1 s" in trial.run("hangs", tmp_path / "a").said
    finally:
        trial.close()
