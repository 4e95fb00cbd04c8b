"""Good results stay, whatever goes wrong: in the first batch or in a later one.

Three clips lie in two local folders and in a store. Each trial causes one trouble, in a first batch or in a second one
after all clips were measured well, and afterwards the trouble is over. Every good file that was there before is there
after, with equal bytes or as a newer good result; and the batch after the trouble has the files of one without.
"""

from __future__ import annotations

import contextlib
import resource
import shutil
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import fsspec
import numpy as np
import pytest

from anglecam.batch.lock import locked, start_run
from anglecam.batch.output_folder import OutputFolder
from anglecam.batch.run import Options, Result, run_batch
from anglecam.camera.calibration import Calibration, write_calibration
from anglecam.errors import InputError, RigError
from support.dask_cluster import dask_cluster
from support.tiny import results, tiny_clip, tiny_lab
from support.tiny import run_batch as run_program

pytestmark = pytest.mark.usefixtures("shared_processes")

QUIET = Options(jobs=1, quiet=True)
STORE = "memory://shelf"
MON, TUE, SHELF = "mon/a", "tue/b", "shelf/c"


@dataclass(frozen=True)
class Lab:
    """The clips, and the results of an undisturbed batch."""

    folder: Path
    out: Path
    """A finished batch, to be copied."""
    files: dict[str, bytes]
    """Its files."""
    newer: dict[str, bytes]
    """The files of the first clip after its bytes have changed."""

    @property
    def asked(self) -> list[str]:
        return [str(self.folder), STORE]

    @property
    def clip(self) -> Path:
        return self.folder / "mon" / "a.avi"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    top = tmp_path_factory.mktemp("stay")
    folder = tiny_lab(top / "lab", ["mon/a.avi", "tue/b.avi"])
    matrix = np.array([[400.0, 0.0, 79.5], [0.0, 400.0, 59.5], [0.0, 0.0, 1.0]])
    write_calibration(Calibration(None, matrix, np.array([-0.05, 0, 0, 0])), folder / "mon" / "lens.yaml")
    (folder / "mon" / "rig.yaml").write_text("camera: {calibration: lens.yaml}\n")
    fsspec.filesystem("memory").put(str(tiny_clip(top / "c.avi", 2)), "/shelf/shelf/c.avi")
    lab = Lab(folder, top / "out", {}, {})
    assert not run_batch(lab.asked, lab.out, QUIET).problems
    old = lab.clip.read_bytes()
    tiny_clip(lab.clip, 3)
    assert not run_batch([str(folder)], top / "newer", QUIET).problems
    lab.clip.write_bytes(old)
    newer = {name: content for name, content in good(top / "newer").items() if name.startswith(MON)}
    return replace(lab, files=results(lab.out), newer=newer)


@pytest.fixture
def lab(made, tmp_path):
    """Give the lab, and bring its folder back to what it was."""
    shutil.copytree(made.folder, tmp_path / "backup")
    yield made
    shutil.rmtree(made.folder)
    shutil.copytree(tmp_path / "backup", made.folder)


def good(out):
    """Return the measured files: everything but the index."""
    return {name: content for name, content in results(out).items() if not name.startswith("index.")}


def attempt(asked: list[str], out: Path, options: Options) -> Result | RigError | InputError:
    """Run a batch and return its result, or the error that ended it."""
    try:
        return run_batch(asked, out, options)
    except (RigError, InputError) as problem:
        return problem


def mistyped_rig(lab, out, monkeypatch):
    (lab.folder / "mon" / "rig.yaml").write_text("pivott: {}\n")
    return attempt(lab.asked, out, QUIET)


def calibration_missing(lab, out, monkeypatch):
    (lab.folder / "mon" / "lens.yaml").unlink()
    return attempt(lab.asked, out, QUIET)


def store_down(lab, out, monkeypatch):
    def refuse(*_, **__):
        raise ConnectionError("503: no answer")

    for method in ("isdir", "isfile", "find", "ls", "size", "get_file", "cat_file"):
        monkeypatch.setattr(type(fsspec.filesystem("memory")), method, refuse)
    return attempt(lab.asked, out, QUIET)


def share_unmounted(lab, out, monkeypatch):
    shutil.rmtree(lab.folder / "tue")
    (lab.folder / "tue").mkdir()
    return attempt(lab.asked, out, QUIET)


def time_limit(lab, out, monkeypatch):
    tiny_clip(lab.clip, 3)
    return attempt(lab.asked, out, replace(QUIET, time_limit=0.001))


def clip_replaced_by_garbage(lab, out, monkeypatch):
    lab.clip.write_text("not a film\n" * 50)
    return attempt(lab.asked, out, QUIET)


def clip_deleted(lab, out, monkeypatch):
    lab.clip.unlink()
    (lab.folder / "mon" / "notes.txt").touch()
    return attempt(lab.asked, out, QUIET)


def disk_full(lab, out, monkeypatch):
    tiny_clip(lab.clip, 3)
    little = partial(resource.setrlimit, resource.RLIMIT_FSIZE, (3000, 3000))  # tables fit, plots do not
    call = run_program(lab.folder, "--out", out, "--jobs", 1, "--quiet", preexec_fn=little)
    assert call.returncode == 1
    return InputError("; ".join(call.stderr.splitlines()))


def two_batches_at_once(lab, out, monkeypatch):
    tiny_clip(lab.clip, 3)
    out.mkdir(exist_ok=True)
    with locked(OutputFolder(out)):
        start_run(OutputFolder(out))
        return attempt(lab.asked, out, QUIET)


def other_version(lab, out, monkeypatch):
    tiny_clip(lab.clip, 3)
    with dask_cluster(out.parent, [None, "9.9.9"]) as cluster:
        return attempt([str(lab.folder)], out, replace(QUIET, dask=cluster.address))


def killed_scheduler(lab, out, monkeypatch):
    tiny_clip(lab.clip, 3)
    with dask_cluster(out.parent) as cluster:

        def kill():
            while not list((out / ".anglecam" / "unfinished").glob("*/*/out")):  # a worker measures
                time.sleep(0.005)
            cluster.scheduler.kill()

        killer = threading.Thread(target=kill)
        killer.start()
        ended = attempt([str(lab.folder)], out, replace(QUIET, dask=cluster.address))
        killer.join()
    return ended


@dataclass(frozen=True)
class Trial:
    """One trouble, and what a batch says of it."""

    cause: Callable[..., Result | RigError | InputError]
    first: str
    """The line of a first batch about the trouble, or a part of it."""
    second: str
    """The line of a second batch; empty where it says nothing."""
    stale: tuple[str, ...] = ()
    """Clips that the second batch calls stale."""
    lines: int = 1
    """Number of lines of the first batch."""


TRIALS = (
    Trial(mistyped_rig, "mon/rig.yaml: unknown key pivott", "mon/rig.yaml: unknown key pivott"),
    Trial(calibration_missing, "lens.yaml: calibration cannot be read", "lens.yaml: calibration cannot be read"),
    Trial(store_down, "shelf: cannot be read (503: no answer)", "shelf: cannot be read (503: no answer)"),
    Trial(share_unmounted, "", "tue: is empty, although clips were measured from it (1)", lines=0),
    Trial(time_limit, "mon/a.avi: took longer", "mon/a.avi: took longer than its time limit", (MON,), lines=3),
    Trial(clip_replaced_by_garbage, "mon/a.avi: not a readable", "a.avi: not a readable video file", (MON,)),
    Trial(clip_deleted, "", "", (MON,), lines=0),
    Trial(
        disk_full, "the results cannot be written (File too large)", "the results cannot be written (File too large)"
    ),
    Trial(two_batches_at_once, "another batch is at work there", "another batch is at work there"),
    Trial(other_version, "", "", lines=0),
    Trial(killed_scheduler, "the scheduler is lost", "the scheduler is lost"),
)


def lines_of(ended: Result | RigError | InputError) -> list[str]:
    return [str(problem) for problem in ended.problems] if isinstance(ended, Result) else [str(ended)]


@pytest.mark.parametrize("trial", TRIALS, ids=lambda trial: trial.cause.__name__)
def test_trouble_in_the_first_batch_costs_only_what_it_concerns(trial, lab, tmp_path):
    out = tmp_path / "out"
    with pytest.MonkeyPatch.context() as patch:
        lines = lines_of(trial.cause(lab, out, patch))
    assert len(lines) == trial.lines
    assert not lines or trial.first in lines[0]
    expected = {name: {content} for name, content in lab.files.items()}
    for name, content in lab.newer.items():
        expected[name].add(content)
    here = good(out) if (out / "index.csv").exists() else {}
    assert all(content in expected[name] for name, content in here.items())
    restore(lab, tmp_path)
    assert not run_batch(lab.asked, out, replace(QUIET, retry_failed=True)).problems
    assert results(out) == lab.files


@pytest.mark.parametrize("trial", TRIALS, ids=lambda trial: trial.cause.__name__)
def test_trouble_in_a_second_batch_leaves_every_good_file(trial, lab, tmp_path):
    out = shutil.copytree(lab.out, tmp_path / "out")
    with pytest.MonkeyPatch.context() as patch:
        ended = trial.cause(lab, out, patch)
    lines = lines_of(ended)
    assert len(lines) == bool(trial.second)
    assert trial.second in "".join(lines)
    found, before = good(out), good(lab.out)
    assert found in (before, before | lab.newer)
    if isinstance(ended, Result):
        status = {row.series.removesuffix(".angles.csv"): row.status for row in ended.rows}
        assert status == {name: "stale" if name in trial.stale else "ok" for name in (MON, TUE, SHELF)}
    restore(lab, tmp_path)
    assert not run_batch(lab.asked, out, QUIET).problems
    assert results(out) == lab.files


def restore(lab, tmp_path):
    """End the trouble."""
    shutil.rmtree(lab.folder)
    shutil.copytree(tmp_path / "backup", lab.folder)


def test_results_that_are_stale_are_removed_on_request_only_and_listed(lab, tmp_path, batch_here):
    out = shutil.copytree(lab.out, tmp_path / "out")
    lab.clip.write_text("not a film\n" * 50)
    (lab.folder / "tue" / "b.avi").rename(tmp_path / "b.avi")
    (lab.folder / "tue" / "notes.txt").touch()
    call = batch_here(*lab.asked, "--out", out, "--quiet")
    assert call.returncode == 1
    assert good(out) == good(lab.out)
    call = batch_here(*lab.asked, "--out", out, "--quiet", "--prune")
    assert call.returncode == 1
    cause = "not a readable video file (Invalid data found when processing input)"
    assert call.stdout.splitlines() == [
        f"removed mon/a.angles.csv, mon/a.html, mon/a.png, mon/a.thumb.webp: {lab.clip}: {cause}; "
        "the earlier results stay, "
        "but these have changed: clip",
        f"removed tue/b.angles.csv, tue/b.html, tue/b.png, tue/b.thumb.webp: {lab.folder}/tue/b.avi: "
        "no such clip any more; its results stay",
    ]
    assert set(good(out)) == {name for name in good(lab.out) if name.startswith("shelf/")}
    with (out / "index.csv").open() as stream:
        assert [line.partition(",")[0] for line in stream] == ["path", str(lab.clip), f"{STORE}/shelf/c.avi"]
    with contextlib.suppress(FileNotFoundError):
        (tmp_path / "b.avi").unlink()
