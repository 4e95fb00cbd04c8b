"""Troubles of a batch: each is caused in a first batch or in a later one, and afterwards it is over.

Three clips lie in two local folders and in a store. `TRIALS` states what the batch prints and returns.
"""

from __future__ import annotations

import contextlib
import csv
import io
import os
import resource
import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from unittest import mock

import fsspec
import numpy as np

from anglecam.batch.lock import locked, start_run
from anglecam.batch.output_folder import OutputFolder
from anglecam.camera.calibration import Calibration, write_calibration
from anglecam.cli.app import main

from .dask_cluster import dask_cluster
from .tiny import results, run_batch, tiny_clip, tiny_lab

STORE = "memory://shelf"
MON, TUE, SHELF = "mon/a", "tue/b", "shelf/c"


@dataclass(frozen=True)
class Call:
    """What a batch returns and prints."""

    status: int
    """Its exit status."""
    lines: tuple[str, ...]
    """Its lines on standard error."""


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


def call_batch(*arguments: object) -> Call:
    """Run the command in this process."""
    printed = io.StringIO()
    line = ["anglecam", "batch", *map(str, arguments), "--quiet"]
    status = 0
    with mock.patch.object(sys, "argv", line), contextlib.redirect_stderr(printed):
        try:
            main()
        except SystemExit as ended:
            status = int(ended.code or 0)
    return Call(status, tuple(printed.getvalue().splitlines()))


def make_lab(top: Path) -> Lab:
    """Write the clips and measure them, once as they are and once after the first has changed."""
    folder = tiny_lab(top / "lab", ["mon/a.avi", "tue/b.avi"])
    matrix = np.array([[400.0, 0.0, 79.5], [0.0, 400.0, 59.5], [0.0, 0.0, 1.0]])
    write_calibration(Calibration(None, matrix, np.array([-0.05, 0, 0, 0])), folder / "mon" / "lens.yaml")
    (folder / "mon" / "rig.yaml").write_text("camera: {calibration: lens.yaml}\n")
    fsspec.filesystem("memory").put(str(tiny_clip(top / "c.avi", 2)), "/shelf/shelf/c.avi")
    lab = Lab(folder, top / "out", {}, {})
    assert call_batch(*lab.asked, "--jobs", 1, "--out", lab.out) == Call(0, ())
    with restored(lab):
        tiny_clip(lab.clip, 3)
        assert call_batch(folder, "--jobs", 1, "--out", top / "newer") == Call(0, ())
    newer = {name: content for name, content in good(top / "newer").items() if name.startswith(MON)}
    return replace(lab, files=results(lab.out), newer=newer)


@contextlib.contextmanager
def restored(lab: Lab) -> Iterator[None]:
    """Bring the lab's folder back to what it was, after the block."""
    backup = lab.folder.with_name("backup")
    shutil.copytree(lab.folder, backup)
    try:
        yield
    finally:
        shutil.rmtree(lab.folder)
        backup.rename(lab.folder)


def good(out: Path) -> dict[str, bytes]:
    """Return the measured files: everything but the index; none if there is no index."""
    found = results(out) if (out / "index.csv").exists() else {}
    return {name: content for name, content in found.items() if not name.startswith("index.")}


def statuses(out: Path) -> dict[str, str]:
    """Return the status of every clip with results, by the path of its results."""
    with (out / "index.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    return {row["series"].removesuffix(".angles.csv"): row["status"] for row in rows if row["series"]}


def mistyped_rig(lab: Lab, out: Path) -> Call:
    (lab.folder / "mon" / "rig.yaml").write_text("pivott: {}\n")
    return call_batch(*lab.asked, "--jobs", 1, "--out", out)


def calibration_missing(lab: Lab, out: Path) -> Call:
    (lab.folder / "mon" / "lens.yaml").unlink()
    return call_batch(*lab.asked, "--jobs", 1, "--out", out)


def store_down(lab: Lab, out: Path) -> Call:
    methods = ("isdir", "isfile", "find", "ls", "size", "get_file", "cat_file")
    refuse = dict.fromkeys(methods, mock.Mock(side_effect=ConnectionError("503: no answer")))
    with mock.patch.multiple(type(fsspec.filesystem("memory")), **refuse):
        return call_batch(*lab.asked, "--jobs", 1, "--out", out)


def share_unmounted(lab: Lab, out: Path) -> Call:
    shutil.rmtree(lab.folder / "tue")
    (lab.folder / "tue").mkdir()
    return call_batch(*lab.asked, "--jobs", 1, "--out", out)


def time_limit(lab: Lab, out: Path) -> Call:
    tiny_clip(lab.clip, 3)
    return call_batch(*lab.asked, "--jobs", 1, "--out", out, "--time-limit", 0.001)


def disk_full(lab: Lab, out: Path) -> Call:
    tiny_clip(lab.clip, 3)

    def little_room() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (3000, 3000))  # tables fit, plots do not

    ended = run_batch(lab.folder, "--out", out, "--jobs", 1, "--quiet", preexec_fn=little_room)
    return Call(ended.returncode, tuple(ended.stderr.splitlines()))


def clip_replaced_by_garbage(lab: Lab, out: Path) -> Call:
    lab.clip.write_text("not a film\n" * 50)
    return call_batch(*lab.asked, "--jobs", 1, "--out", out)


def clip_deleted(lab: Lab, out: Path) -> Call:
    lab.clip.unlink()
    (lab.folder / "mon" / "notes.txt").touch()
    return call_batch(*lab.asked, "--jobs", 1, "--out", out)


def two_batches_at_once(lab: Lab, out: Path) -> Call:
    tiny_clip(lab.clip, 3)
    out.mkdir(exist_ok=True)
    with locked(OutputFolder(out)):
        start_run(OutputFolder(out))
        return call_batch(*lab.asked, "--jobs", 1, "--out", out)


def other_version(lab: Lab, out: Path) -> Call:
    tiny_clip(lab.clip, 3)
    with dask_cluster(out.parent, [None, "9.9.9"]) as cluster:
        return call_batch(lab.folder, "--out", out, "--dask", cluster.address)


def only_another_version(lab: Lab, out: Path) -> Call:
    tiny_clip(lab.clip, 3)
    no_patience = mock.patch("anglecam.batch.dask_pool._WAIT_S", 1.0)
    with dask_cluster(out.parent, ["9.9.9"]) as cluster, no_patience:
        return call_batch(lab.folder, "--out", out, "--dask", cluster.address)


def killed_scheduler(lab: Lab, out: Path) -> Call:
    tiny_clip(lab.clip, 3)
    with dask_cluster(out.parent) as cluster:

        def kill() -> None:
            while not list((out / ".anglecam" / "unfinished").glob("*/*/out")):  # a worker measures
                time.sleep(0.005)
            cluster.scheduler.kill()

        killer = threading.Thread(target=kill)
        killer.start()
        ended = call_batch(lab.folder, "--out", out, "--dask", cluster.address)
        killer.join()
    return ended


@dataclass(frozen=True)
class Said:
    """What a batch says of a trouble."""

    status: int
    """Its exit status."""
    lines: tuple[str, ...] = ()
    """A part of each of its lines, in their order."""


@dataclass(frozen=True)
class Trial:
    """One trouble, and what a batch says of it."""

    cause: Callable[[Lab, Path], Call]
    first: Said
    """A first batch."""
    second: Said
    """A batch after one in which all clips were measured."""
    stale: tuple[str, ...] = ()
    """Clips that the second batch calls stale."""

    @property
    def name(self) -> str:
        return self.cause.__name__.replace("_", " ")


def _always(status: int, *lines: str) -> tuple[Said, Said]:
    return Said(status, lines), Said(status, lines)


_TOO_LONG = "took longer than its time limit of 0.001 s"
_REFUSED = "gets no jobs: anglecam 9.9.9, but the batch was started by"
TRIALS = (
    Trial(mistyped_rig, *_always(2, "mon/rig.yaml: unknown key pivott")),
    Trial(other_version, *_always(0, _REFUSED)),
    Trial(
        only_another_version,
        *_always(2, _REFUSED, "waiting up to 1 s for another worker", "no worker there can do the jobs of this batch"),
    ),
    Trial(store_down, *_always(1, "shelf: cannot be read (503: no answer)")),
    Trial(share_unmounted, Said(0), Said(1, ("tue: is empty, although clips were measured from it (1)",))),
    Trial(
        time_limit,
        Said(1, tuple(f"{clip}.avi: {_TOO_LONG}" for clip in (MON, TUE, SHELF))),
        Said(1, (f"{MON}.avi: {_TOO_LONG}; the earlier results stay, but these have changed: clip",)),
        stale=(MON,),
    ),
    Trial(disk_full, *_always(1, "the results cannot be written (File too large); the same call goes on from here")),
    Trial(
        clip_replaced_by_garbage,
        *_always(1, "mon/a.avi: not a readable video file (Invalid data found when processing input)"),
        stale=(MON,),
    ),
    Trial(clip_deleted, Said(0), Said(0), stale=(MON,)),
    Trial(calibration_missing, *_always(2, "mon/lens.yaml: calibration cannot be read")),
    Trial(killed_scheduler, *_always(1, "the scheduler is lost")),
    Trial(two_batches_at_once, *_always(2, f"another batch is at work there (process {os.getpid()} on")),
)
