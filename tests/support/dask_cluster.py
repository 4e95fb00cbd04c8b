"""A Dask scheduler and workers in processes of their own, as a user starts them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from distributed import Client

_PROGRAM = "from dask.__main__ import main; main()"
_ENDS_WITH_TEST = f"from anglecam.end_with_parent import end_with_parent; end_with_parent({os.getpid()}); "


@dataclass(frozen=True)
class Cluster:
    """A running scheduler with its workers."""

    address: str
    scheduler: subprocess.Popen[bytes]
    workers: list[subprocess.Popen[bytes]]
    start_worker: Callable[[str | None], None]
    """Starts another worker, of a version of anglecam; see `dask_cluster`."""


@contextmanager
def dask_cluster(folder: Path, versions: Sequence[str | None] = (None, None)) -> Iterator[Cluster]:
    """Start a scheduler and one worker for each version of anglecam; ``None`` is the version that is installed."""
    file = folder / "scheduler.json"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": folder}

    def start(program: str, *arguments: object) -> subprocess.Popen[bytes]:
        return subprocess.Popen([sys.executable, "-c", _ENDS_WITH_TEST + program, *map(str, arguments)], **quiet)

    scheduler = start(
        _PROGRAM, "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", file
    )
    workers: list[subprocess.Popen[bytes]] = []

    def start_worker(version: str | None) -> None:
        worker = start(
            _PROGRAM if version is None else f"import anglecam; anglecam.__version__ = {version!r}; {_PROGRAM}",
            *("worker", "--scheduler-file", file, "--nthreads", "1", "--no-dashboard"),
            *(() if version is None else ("--no-nanny",)),  # a nanny's worker is a new program
        )
        workers.append(worker)

    for version in versions:
        start_worker(version)
    try:
        until = time.monotonic() + 120.0
        while not file.exists() or not file.read_text():
            assert time.monotonic() < until
            time.sleep(0.05)
        address = json.loads(file.read_text())["address"]
        with Client(address, timeout=60) as client:
            client.wait_for_workers(len(workers), timeout=120)
        yield Cluster(address, scheduler, workers, start_worker)
    finally:
        for process in (*workers, scheduler):
            process.terminate()
        for process in (*workers, scheduler):
            try:
                process.wait(1)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
