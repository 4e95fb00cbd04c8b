"""Failing disks and changing files: one line for each, and all clips that can be measured are."""

from __future__ import annotations

import ctypes
import os
import resource
import signal
import threading
import time

import pytest

from anglecam.batch.run import Options, run_batch
from support.measured_here import run_batch as run_here
from support.tiny import children, command_line, tiny_clip, tiny_lab, unfinished
from support.tiny import run_batch as run

PR_CAPBSET_DROP, CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH = 24, 1, 2
QUIET = Options(jobs=1, quiet=True)


def bound_by_permissions():
    """Drop root's right to read and write everything, because tests are often run by root."""
    for capability in (CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH):
        ctypes.CDLL(None).prctl(PR_CAPBSET_DROP, capability)


def test_permission_denied_affects_only_the_clip_or_folder_concerned(tmp_path):
    lab, out = tiny_lab(tmp_path / "clips", ["a.avi", "b.avi", "locked/c.avi"]), tmp_path / "out"
    (out / "sub").mkdir(parents=True)
    tiny_clip(lab / "sub" / "d.avi", 3)
    (lab / "b.avi").chmod(0)
    (lab / "locked").chmod(0)
    (out / "sub").chmod(0o500)
    call = run(lab, "--out", out, "--quiet", preexec_fn=bound_by_permissions)
    assert call.returncode == 1
    assert call.stderr.splitlines() == [
        f"{lab}/locked: cannot be searched (Permission denied)",
        f"{lab}/sub/d.avi: the results cannot be written (Permission denied)",
        f"{lab}/b.avi: Permission denied",
    ]
    assert (out / "a.angles.csv").exists()
    (lab / "locked").chmod(0o700)


def test_an_output_folder_that_cannot_be_written_to_is_reported_in_one_line(tmp_path):
    lab, out = tiny_lab(tmp_path / "clips", ["a.avi"]), tmp_path / "out"
    out.mkdir()
    out.chmod(0o555)
    call = run(lab, "--out", out, preexec_fn=bound_by_permissions)
    assert call.returncode == 2
    assert call.stderr.splitlines() == [f"--out {out}: cannot be written to (Permission denied)"]


def test_a_full_disk_stops_the_batch_with_one_line_and_leaves_no_partial_results(tmp_path):
    lab, out = tiny_lab(tmp_path / "clips", ["a.avi", "b.avi"]), tmp_path / "out"

    def little_room():
        resource.setrlimit(resource.RLIMIT_FSIZE, (3000, 3000))  # tables fit, plots do not

    call = run(lab, "--out", out, "--quiet", preexec_fn=little_room)
    assert call.returncode == 1
    assert call.stderr.splitlines() == [
        f"--out {out}: the results cannot be written (File too large); the same call goes on from here"
    ]
    assert not list(out.glob("*.angles.csv"))
    assert unfinished(out) == []
    assert not run_here([str(lab)], out, QUIET).problems  # there is space again


def test_a_clip_that_is_removed_or_rewritten_while_it_is_read_is_reported(tmp_path):
    lab, out = tiny_lab(tmp_path / "clips", ["a.avi", "b.avi", "c.avi"]), tmp_path / "out"

    def meddle():
        while not list((out / ".anglecam" / "unfinished").glob("*/*/out")):  # a is being measured
            time.sleep(0.001)
        (lab / "a.avi").write_bytes((lab / "a.avi").read_bytes())
        (lab / "b.avi").unlink()

    meddler = threading.Thread(target=meddle)
    meddler.start()
    result = run_batch([str(lab)], out, QUIET)
    meddler.join()
    assert [row.status for row in result.rows] == ["failed", "failed", "ok"]
    assert [str(problem) for problem in result.problems] == [
        f"{lab}/a.avi: it changed while it was being measured",
        f"{lab}/b.avi: no such file",
    ]
    assert [row.status for row in run_here([str(lab)], out, QUIET).rows] == ["ok", "ok"]


@pytest.mark.filterwarnings("ignore:Glyph")  # the font of the plots does not have every sign
def test_a_clip_of_any_file_name_is_measured_and_listed(tmp_path):
    names = ["new\nline.avi", "Ⅳ θ 日本　語.avi", os.fsdecode(b"not-utf8-\xff.avi"), "-o.avi", "a'b;$x$_.avi"]
    lab, out = tiny_lab(tmp_path / "clips", names), tmp_path / "out"
    result = run_here([str(lab)], out, QUIET)
    assert [row.status for row in result.rows] == ["ok"] * 5
    assert all((out / f"{name.removesuffix('.avi')}.angles.csv").exists() for name in names)
    assert len((out / "index.csv").read_text().splitlines()) == 6


def test_every_clip_that_takes_too_long_gives_one_line(tmp_path):
    lab = tiny_lab(tmp_path / "clips", ["a.avi", "b.avi"])
    result = run_batch([str(lab)], tmp_path / "out", Options(jobs=2, quiet=True, time_limit=0.01))
    assert [str(p) for p in result.problems] == [
        f"{lab}/{k}.avi: took longer than its time limit of 0.01 s" for k in "ab"
    ]


def test_a_process_that_hangs_is_ended_by_its_time_limit(tmp_path):
    lab, out = tiny_lab(tmp_path / "clips", ["a.avi"]), tmp_path / "out"
    others = children(os.getpid())  # measuring processes that other tests share

    def is_new(child):
        return child not in others and "anglecam.batch.serve" in command_line(child)

    def stop():
        # not before it runs its program: stopping a fork of this process before its exec would stop this process, too
        while not (mine := [c for c in children(os.getpid()) if is_new(c)]):
            time.sleep(0.001)
        os.kill(mine[0], signal.SIGSTOP)

    stopper = threading.Thread(target=stop)
    stopper.start()
    result = run_batch([str(lab)], out, Options(jobs=1, quiet=True, time_limit=1.0))
    stopper.join()
    assert "took longer than its time limit of 1 s" in str(result.problems[0])
