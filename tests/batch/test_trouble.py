"""What disks and people do to a batch: one line for each clip it costs, and the rest done."""

from __future__ import annotations

import ctypes
import os
import resource
import signal
import threading
import time

from anglecam.batch.run import Options, run_batch
from support.tiny import children, command_line, tiny_clip, tiny_lab, unfinished
from support.tiny import run_batch as run

PR_CAPBSET_DROP, CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH = 24, 1, 2
QUIET = Options(jobs=1, quiet=True)


def bound_by_permissions():
    """Give up root's right to read and write everything: tests are often run by root."""
    for capability in (CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH):
        ctypes.CDLL(None).prctl(PR_CAPBSET_DROP, capability)


def test_permission_denied_costs_the_clip_or_the_folder_that_it_is_about(tmp_path):
    lab, out = tiny_lab(tmp_path / "clips", ["a.avi", "b.avi", "locked/c.avi"]), tmp_path / "out"
    (out / "sub").mkdir(parents=True)
    tiny_clip(lab / "sub" / "d.avi", 3)
    (lab / "b.avi").chmod(0)
    (lab / "locked").chmod(0)
    (out / "sub").chmod(0o500)
    told = run(lab, "--out", out, "--quiet", preexec_fn=bound_by_permissions)
    assert told.returncode == 1
    assert told.stderr.splitlines() == [
        f"{lab}/locked: cannot be searched (Permission denied)",
        f"{lab}/b.avi: Permission denied",
        f"{lab}/sub/d.avi: the results cannot be written (Permission denied)",
    ]
    assert (out / "a.angles.csv").exists()
    (lab / "locked").chmod(0o700)


def test_an_output_folder_that_cannot_be_written_to_is_told_in_one_line(tmp_path):
    lab, out = tiny_lab(tmp_path / "clips", ["a.avi"]), tmp_path / "out"
    out.mkdir()
    out.chmod(0o555)
    told = run(lab, "--out", out, preexec_fn=bound_by_permissions)
    assert told.returncode == 2
    assert told.stderr.splitlines() == [f"--out {out}: cannot be written to (Permission denied)"]


def test_a_full_disk_is_one_line_a_clip_and_leaves_nothing_that_looks_whole(tmp_path):
    lab, out = tiny_lab(tmp_path / "clips", ["a.avi", "b.avi"]), tmp_path / "out"

    def little_room():
        resource.setrlimit(resource.RLIMIT_FSIZE, (3000, 3000))  # tables fit, pictures do not

    told = run(lab, "--out", out, "--quiet", preexec_fn=little_room)
    assert told.returncode == 1
    lines = told.stderr.splitlines()
    assert lines[:2] == [f"{lab}/{k}.avi: the results cannot be written (File too large)" for k in "ab"]
    assert [line.partition(":")[0] for line in lines[2:]] in ([], [f"{out}/index.csv"])
    assert not list(out.glob("*.angles.csv"))
    assert unfinished(out) == []
    assert not run_batch([str(lab)], out, QUIET).problems  # there is room again


def test_a_clip_that_is_removed_or_rewritten_while_it_is_read_is_told(tmp_path):
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
    assert [row.status for row in run_batch([str(lab)], out, QUIET).rows] == ["ok", "ok"]


def test_any_file_name_is_measured_and_told_of(tmp_path):
    names = ["new\nline.avi", "Ⅳ θ 日本　語.avi", os.fsdecode(b"not-utf8-\xff.avi"), "-o.avi", "a'b;$x$_.avi"]
    lab, out = tiny_lab(tmp_path / "clips", names), tmp_path / "out"
    result = run_batch([str(lab)], out, QUIET)
    assert [row.status for row in result.rows] == ["ok"] * 5
    assert all((out / f"{name.removesuffix('.avi')}.angles.csv").exists() for name in names)
    assert len((out / "index.csv").read_text().splitlines()) == 6


def test_all_clips_taking_too_long_is_a_line_each(tmp_path):
    lab = tiny_lab(tmp_path / "clips", ["a.avi", "b.avi"])
    result = run_batch([str(lab)], tmp_path / "out", Options(jobs=2, quiet=True, time_limit=0.01))
    assert [str(p) for p in result.problems] == [
        f"{lab}/{k}.avi: took longer than its time limit of 0.01 s" for k in "ab"
    ]


def test_a_process_that_hangs_is_ended_by_its_time_limit(tmp_path):
    lab, out = tiny_lab(tmp_path / "clips", ["a.avi"]), tmp_path / "out"

    def stop():
        # not before it runs its own program: a copy of this process that is stopped on the way there stops this one too
        while not (mine := [c for c in children(os.getpid()) if "anglecam.batch.child" in command_line(c)]):
            time.sleep(0.001)
        os.kill(mine[0], signal.SIGSTOP)

    stopper = threading.Thread(target=stop)
    stopper.start()
    result = run_batch([str(lab)], out, Options(jobs=1, quiet=True, time_limit=1.0))
    stopper.join()
    assert "took longer than its time limit of 1 s" in str(result.problems[0])
