"""The same jobs on Dask workers, in real processes; one of them is killed."""

from __future__ import annotations

import os
import signal
import subprocess
import threading
import time

import pytest

from anglecam.batch.run import Options
from anglecam.errors import InputError, RigError
from support.dask_cluster import dask_cluster
from support.measured_here import run_batch
from support.tiny import batch_command, children, is_alive, results, tiny_clip, tiny_lab

pytest.importorskip("distributed")


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """Start a scheduler and two workers as a user does; the last tests that use them kill one, and the scheduler."""
    with dask_cluster(tmp_path_factory.mktemp("cluster")) as started:
        yield started


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    return tiny_lab(tmp_path_factory.mktemp("lab"), [f"{k}.avi" for k in range(6)])


@pytest.fixture(scope="module")
def without_dask(lab, tmp_path_factory):
    """Return what a batch without Dask gives."""
    out = tmp_path_factory.mktemp("here")
    assert not run_batch([str(lab)], out, Options(jobs=2, quiet=True)).problems
    return results(out)


@pytest.mark.sweep  # beside a batch without Dask: `test_a_batch_that_is_killed_and_resumed_…` of `test_kill.py`
def test_what_workers_finish_while_the_batch_is_killed_is_not_measured_again(cluster, lab, without_dask, tmp_path):
    address, out = cluster.address, tmp_path / "out"
    batch = subprocess.Popen(batch_command(lab, "--out", out, "--dask", address, "--quiet"))
    until = time.monotonic() + 120.0
    unfinished = out / ".anglecam" / "unfinished"
    while not list(unfinished.glob("*/*/out")):  # a worker is measuring
        assert time.monotonic() < until
        time.sleep(0.005)
    batch.send_signal(signal.SIGSTOP)
    while not (left := list(unfinished.glob("*/*/result.json"))):
        assert time.monotonic() < until
        time.sleep(0.005)
    batch.kill()
    batch.wait()
    made = {path.name: path.stat().st_mtime_ns for path in (left[0].parent / "out").iterdir()}
    assert not run_batch([str(lab)], out, Options(jobs=2, quiet=True)).problems
    assert made == {name: (out / name).stat().st_mtime_ns for name in made}
    assert results(out) == without_dask


def test_a_worker_that_is_killed_loses_no_clip(cluster, lab, without_dask, tmp_path):
    address, workers, out = cluster.address, cluster.workers, tmp_path / "out"
    killed = []

    def kill_one():
        while len(list(out.glob("*.angles.csv"))) < 2:
            time.sleep(0.005)
        nanny = workers[0].pid
        below = children(nanny)
        for pid in (nanny, *below):
            os.kill(pid, signal.SIGKILL)
            killed.append(pid)

    killer = threading.Thread(target=kill_one)
    killer.start()
    result = run_batch([str(lab)], out, Options(jobs=1, quiet=True, dask=address))
    killer.join()
    assert killed
    assert not any(map(is_alive, killed))
    assert not result.problems
    assert [row.status for row in result.rows] == ["ok"] * 6
    assert results(out) == without_dask


def test_a_lost_scheduler_ends_the_batch_in_one_line_and_good_results_stay(cluster, tmp_path):
    lab, out, here = tiny_lab(tmp_path / "lab", ["a.avi"]), tmp_path / "out", Options(jobs=1, quiet=True)
    assert not run_batch([str(lab)], out, here).problems
    good = (out / "a.angles.csv").read_bytes()
    tiny_clip(lab / "b.avi", 1)

    def kill():
        while not list((out / ".anglecam" / "unfinished").glob("*/*/out")):  # a worker measures
            time.sleep(0.005)
        cluster.scheduler.kill()

    killer = threading.Thread(target=kill)
    killer.start()
    with pytest.raises(InputError, match=r"^--dask .*: the scheduler is lost \(.*\); the same call goes on from here$"):
        run_batch([str(lab)], out, Options(jobs=1, quiet=True, dask=cluster.address))
    killer.join()
    assert (out / "a.angles.csv").read_bytes() == good
    assert [row.status for row in run_batch([str(lab)], out, here).rows] == ["ok", "ok"]


@pytest.mark.sweep  # one clip, so that the loss is noticed elsewhere: the test before
def test_a_scheduler_that_is_lost_when_it_is_asked_for_its_workers_is_named_in_one_line(tmp_path):
    lab = tiny_lab(tmp_path / "lab", [f"{k}.avi" for k in range(8)])  # more than the workers get at once
    with dask_cluster(tmp_path) as cluster:

        def kill():
            while not list((tmp_path / "out").glob("*.angles.csv")):
                time.sleep(0.005)
            cluster.scheduler.kill()

        killer = threading.Thread(target=kill)
        killer.start()
        with pytest.raises(InputError, match=r"^--dask .*: the scheduler is lost \(.*\); the same call goes on from"):
            run_batch([str(lab)], tmp_path / "out", Options(jobs=1, quiet=True, dask=cluster.address))
        killer.join()


def test_an_invalid_scheduler_address_is_refused_at_once(tmp_path):
    lab = tiny_lab(tmp_path / "lab", ["a.avi"])
    with pytest.raises(
        RigError, match=r"^--dask nonsense: neither local nor an address with a port, as tcp://HOST:8786$"
    ):
        run_batch([str(lab)], tmp_path / "out", Options(jobs=1, quiet=True, dask="nonsense"))


def test_a_missing_scheduler_is_reported_in_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr("anglecam.batch.dask_pool._WAIT_S", 1.0)
    lab = tiny_lab(tmp_path / "lab", ["a.avi"])
    with pytest.raises(RigError, match=r"^--dask tcp://127\.0\.0\.1:9: no scheduler with a worker there \(.*\)$"):
        run_batch([str(lab)], tmp_path / "out", Options(jobs=1, quiet=True, dask="tcp://127.0.0.1:9"))


def test_a_scheduler_with_workers_of_other_versions_only_is_refused_and_names_them(tmp_path, capfd, monkeypatch):
    monkeypatch.setattr("anglecam.batch.dask_pool._WAIT_S", 1.0)
    lab = tiny_lab(tmp_path / "lab", ["a.avi"])
    with dask_cluster(tmp_path, ["9.9.9"]) as cluster:
        refused = rf"^--dask {cluster.address}: no worker there can do the jobs of this batch$"
        with pytest.raises(RigError, match=refused):
            run_batch([str(lab)], tmp_path / "out", Options(jobs=1, quiet=True, dask=cluster.address))
    lines = capfd.readouterr().err.splitlines()
    assert len(lines) == 2
    assert "gets no jobs: anglecam 9.9.9, but the batch was started by" in lines[0]
    assert lines[1] == f"--dask {cluster.address}: waiting up to 1 s for another worker"
    assert not list((tmp_path / "out").glob("*.csv"))


@pytest.mark.sweep
def test_a_batch_waits_for_a_worker_of_its_version_that_joins_after_one_of_another(tmp_path, monkeypatch):
    lab, lines = tiny_lab(tmp_path / "lab", ["a.avi"]), []
    with dask_cluster(tmp_path, ["9.9.9"]) as cluster:

        def note(line):
            lines.append(line)
            if "waiting up to" in line:
                cluster.start_worker(None)

        monkeypatch.setattr("anglecam.batch.dask_pool.errors.print", note)
        result = run_batch([str(lab)], tmp_path / "out", Options(jobs=1, quiet=True, dask=cluster.address))
    assert not result.problems
    assert [row.status for row in result.rows] == ["ok"]
    assert sum("gets no jobs" in line for line in lines) == 1
