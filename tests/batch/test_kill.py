"""A batch that is killed at any instant leaves no partial results, and the next batch completes it."""

from __future__ import annotations

import os
import signal
import subprocess
import time

import pytest

from anglecam.batch.measuring_process import MeasuringProcess, ProcessLost
from anglecam.batch.run import Options
from anglecam.errors import RigError
from support.measured_here import run_batch as run_here
from support.tiny import batch_command, children, is_alive, results, tiny_clip, tiny_lab, unfinished
from support.tiny_session import tiny_session

TWO = Options(jobs=2, quiet=True)
NAMES = [f"{folder}/{k}.avi" for folder in ("mon", "tue") for k in range(2)]


def start(*arguments):
    return subprocess.Popen(
        batch_command(*arguments),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # tests in the background may ignore Ctrl-C
    )


def wait_until(true, timeout=60.0):
    until = time.monotonic() + timeout
    while not true():
        assert time.monotonic() < until, "waited in vain"
        time.sleep(0.01)


def end_of(process):
    """Reap a killed batch."""
    process.wait()
    process.stdout.close()
    process.stderr.close()


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    return tiny_lab(tmp_path_factory.mktemp("lab"), NAMES)


@pytest.fixture(scope="module")
def unbroken(lab, tmp_path_factory):
    out = tmp_path_factory.mktemp("unbroken")
    assert not run_here([str(lab)], out, TWO).problems
    return results(out)


@pytest.mark.parametrize("instants", [(1,), pytest.param((1, 3), marks=pytest.mark.sweep)], ids=["once", "twice"])
def test_a_batch_that_is_killed_and_resumed_gives_the_files_of_one_that_is_not_killed(
    lab, unbroken, tmp_path, instants
):
    out = tmp_path / "out"
    for done in instants:
        batch = start(lab, "--out", out, "--jobs", 2, "--quiet")
        wait_until(lambda done=done: len(list(out.glob("*/*.angles.csv"))) >= done)
        workers = children(batch.pid)
        assert workers
        batch.kill()
        end_of(batch)
        wait_until(lambda workers=workers: not any(map(is_alive, workers)))  # measuring processes end with their batch
        whole = {n: c for n, c in unbroken.items() if n.endswith((".csv", ".png")) and n != "index.csv"}
        for path in out.rglob("*"):
            name = str(path.relative_to(out))
            if name in whole:
                assert path.read_bytes() == whole[name]
    assert not run_here([str(lab)], out, Options(jobs=1, quiet=True)).problems
    assert results(out) == unbroken
    assert unfinished(out) == []


@pytest.mark.sweep
def test_a_batch_that_closes_a_loop_survives_a_kill_and_all_its_processes_end(tmp_path):
    session, out = tiny_session(tmp_path / "lab" / "neck", kinds=("stairs", "random")), tmp_path / "out"
    closing = Options(jobs=1, quiet=True, close=True)
    run_here([str(session)], tmp_path / "unbroken", closing)
    batch = start(session, "--out", out, "--jobs", 1, "--quiet", "--close")
    wait_until(lambda: (out / "nod.angles.csv").exists() and list((out / ".anglecam/unfinished").glob("*/*/out")))
    workers = children(batch.pid)  # the session is being fitted
    assert workers
    batch.kill()
    end_of(batch)
    wait_until(lambda: not any(map(is_alive, workers)), 5.0)
    run_here([str(session)], out, closing)
    assert results(out) == results(tmp_path / "unbroken")
    assert "model.mat" in results(out)
    assert "loop.json" in results(out)


@pytest.mark.parametrize("sent", [signal.SIGSEGV, pytest.param(signal.SIGKILL, marks=pytest.mark.sweep)])
def test_a_measuring_process_that_dies_fails_its_clip_only(lab, unbroken, tmp_path, sent):
    out = tmp_path / "out"
    batch = start(lab / "mon", "--out", out, "--jobs", 1, "--quiet")
    wait_until(lambda: children(batch.pid))
    os.kill(children(batch.pid)[0], sent)
    _, stderr = batch.communicate(timeout=120)
    assert batch.returncode == 1
    cause = f"the process that measured it died of signal {int(sent)} ({sent.name})"
    assert stderr.splitlines() == [f"{lab}/mon/0.avi: {cause}"]
    assert sorted(p.name for p in out.glob("*.angles.csv")) == ["1.angles.csv"]


def test_a_clip_that_takes_too_long_is_given_up_and_the_next_is_measured(tmp_path):
    process, clip = MeasuringProcess(), tiny_clip(tmp_path / "a.avi")
    request = {"clip": str(clip), "rig": None, "into": str(tmp_path), "series_file": None}
    with pytest.raises(ProcessLost, match=r"took longer than its time limit of 0\.05 s"):
        process.ask(request, 0.05)
    assert process.ask(request, 60.0)["frames"] == 8
    process.close()


def test_a_second_batch_on_the_same_folder_is_refused_and_a_killed_one_does_not_block_the_next(lab, tmp_path):
    out = tmp_path / "out"
    first = start(lab, "--out", out, "--quiet")
    wait_until(lambda: first.poll() is not None or children(first.pid))
    with pytest.raises(RigError, match=rf"--out {out}: another batch is at work there \(process {first.pid} on .*\)"):
        run_here([str(lab)], out, TWO)
    first.kill()
    end_of(first)
    assert not run_here([str(lab / "tue" / "1.avi")], out, Options(jobs=1, quiet=True)).problems


def test_an_interrupted_batch_ends_at_once_and_unfinished_clips_do_not_count_as_failed(lab, unbroken, tmp_path):
    out = tmp_path / "out"
    batch = start(lab, "--out", out, "--jobs", 1, "--quiet")
    wait_until(lambda: list(out.glob("*/*.angles.csv")))
    batch.send_signal(signal.SIGINT)
    _, stderr = batch.communicate(timeout=30)
    assert batch.returncode not in (0, 2)
    assert stderr.splitlines()[-1] == "stopped; the same call goes on from here"
    assert "Traceback" not in stderr
    assert not run_here([str(lab)], out, TWO).problems
    assert results(out) == unbroken
