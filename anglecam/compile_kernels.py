"""Compile modules with kernels in several processes, none of them twice.

A process is given one module after another and imports it, which compiles its kernels. A module may import others that
have kernels, too: while a process imports one, it holds the module's lock, so that another process that needs the same
module waits and then loads what has been compiled. Modules do not import each other in a circle, so no two processes
wait for each other.

The processes are programs of their own, as in `anglecam.batch.measuring_process`: started anew on every system, and
ended by Linux with the thread that started them. Elsewhere one may outlive a killed parent until its module is
compiled; it holds that module's lock, for which the processes of the next call wait.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from importlib import import_module
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from importlib.util import spec_from_file_location
from pathlib import Path
from queue import Empty, SimpleQueue
from shutil import rmtree
from threading import Event
from types import ModuleType
from typing import Any

from filelock import FileLock

from anglecam import end_with_parent
from anglecam.threads import ONE_THREAD, cores


def compile_modules(package: str, modules: list[str], locks: Path) -> set[str] | None:
    """Import modules in as many processes as there are cores, and say so on standard error.

    Parameters
    ----------
    package : str
        To which they belong.
    modules : list of str
        Their names; one that takes longer should come earlier.
    locks : Path
        Folder for their locks; it is removed in the end.

    Returns
    -------
    set of str or None
        The folders in which Numba keeps what was compiled; ``None`` where a module could not be imported.
    """
    say = partial(print, file=sys.stderr, flush=True)
    say(f"{package}: compiling the numerical kernels, once; this takes up to a minute")
    begin, folders, failed = time.monotonic(), set[str](), list[str]()
    locks.mkdir(exist_ok=True)
    waiting, answers, stop = SimpleQueue[str](), SimpleQueue[tuple[str, list[str] | None]](), Event()
    processes, count = list[subprocess.Popen[str]](), max(1, min(cores(), len(modules)))
    for module in modules:
        waiting.put(module)
    terminal = sys.stderr.isatty()
    with ThreadPoolExecutor(count) as threads:
        for _ in range(count):
            threads.submit(_serve, waiting, answers, lambda: _start(modules, locks, processes), stop)
        try:
            for done in range(len(modules)):
                if terminal:
                    say(f"\r{package}: {done} of {len(modules)} modules", end="")
                module, kept = answers.get()
                folders.update(kept or ())
                failed += [] if kept is not None else [module]
        finally:
            stop.set()
            for process in processes:
                process.kill()  # at work still where the user interrupts it
    rmtree(locks, ignore_errors=True)
    say("\r" * terminal + f"{package}: kernels compiled in {time.monotonic() - begin:.0f} s")
    if failed:
        say(f"{package}: could not be compiled beforehand: {', '.join(failed)}")
    return None if failed else folders


def _serve(
    waiting: SimpleQueue[str],
    answers: SimpleQueue[tuple[str, list[str] | None]],
    start: Callable[[], subprocess.Popen[str]],
    stop: Event,
) -> None:
    """Give a process one module after another; start another process where it ends."""
    process: subprocess.Popen[str] | None = None
    while not stop.is_set():
        try:
            module = waiting.get_nowait()
        except Empty:
            break
        line = ""
        try:
            process = process or start()
            assert process.stdin
            assert process.stdout
            process.stdin.write(f"{module}\n")
            process.stdin.flush()
            line = process.stdout.readline()
        except OSError:
            pass  # it could not be started, or has ended
        whole = line.endswith("\n")
        answers.put((module, json.loads(line) if whole else None))
        if process is not None and not whole:
            process.kill()
            process.communicate()
            process = None
    if process is not None:
        process.kill()
        process.communicate()


def _start(modules: list[str], locks: Path, processes: list[subprocess.Popen[str]]) -> subprocess.Popen[str]:
    program = [sys.executable, "-P", end_with_parent.__file__, str(os.getpid()), __name__, str(locks), *modules]
    path = os.pathsep.join(entry or str(Path.cwd()) for entry in sys.path)
    process = subprocess.Popen(
        program,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,  # the command that needs the module fails by itself, and says why
        text=True,
        env={**os.environ, **ONE_THREAD, "PYTHONPATH": path},
    )
    processes.append(process)
    return process


class _OneAtATime(MetaPathFinder):
    """Has modules imported by one process at a time."""

    def __init__(self, modules: set[str], locks: Path) -> None:
        self._modules, self._locks = modules, locks

    def find_spec(self, fullname: str, path: Any, target: ModuleType | None = None) -> ModuleSpec | None:
        """Find a module; ``None`` for one without kernels, which is left to others."""
        if fullname not in self._modules:
            return None
        found = PathFinder.find_spec(fullname, path, target)
        if found is None or found.origin is None:
            return None
        loader = _LockedLoader(fullname, found.origin)
        loader.lock = self._locks / f"{fullname}.lock"
        return spec_from_file_location(fullname, found.origin, loader=loader)


class _LockedLoader(SourceFileLoader):
    lock: Path

    def exec_module(self, module: ModuleType) -> None:
        with FileLock(self.lock):
            super().exec_module(module)


def _folders_of(module: ModuleType) -> list[str]:
    """Return the folders in which Numba keeps the kernels of a module."""
    paths = [getattr(getattr(value, "_cache", None), "cache_path", None) for value in vars(module).values()]
    return sorted({str(path) for path in paths if path})


def _work() -> None:
    """Import the modules that standard input names, and answer each with the folders of its kernels."""
    locks, modules = Path(sys.argv[3]), sys.argv[4:]
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # whatever prints must not answer
    sys.meta_path.insert(0, _OneAtATime(set(modules), locks))
    for line in sys.stdin:
        print(json.dumps(_folders_of(import_module(line.strip()))), file=answers, flush=True)


if __name__ == "__main__":
    _work()
