"""Measures one film or session in a process of its own, with one thread and a limit of CPU time.

A process that had to compile a kernel pays for that with CPU time which no later one pays: what it measured is measured
again in a second process, and that row counts.
"""

from __future__ import annotations

import multiprocessing
import os
import resource
import signal
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection

from anglecam.threads import ONE_THREAD
from benchmarks.outcomes.case import Meter, Places, Row

CPU_S = 1200
"""Limit of CPU time of one process, s, with the drawing of the film. Beside other work the longest take 500 s."""
WALL_S = 6 * CPU_S
"""Limit of waiting for a process that hangs, s."""


@dataclass(frozen=True)
class Set:
    """Films or sessions that are measured in the same way."""

    names: Callable[[Places], list[str]]
    measure: Callable[[str, Places, Meter], Row]


def row_of(one: Set, name: str, places: Places) -> Row:
    """Measure one film or session; return its row, with the cost where there is an answer."""
    os.environ.update(ONE_THREAD)  # read when the new process loads its libraries
    row = _attempt(one, name, places)
    return _attempt(one, name, places) if row.get("kernels_compiled") else row


def _attempt(one: Set, name: str, places: Places) -> Row:
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=_answer, args=(theirs, one, name, places))
    process.start()
    theirs.close()
    try:
        if ours.poll(WALL_S):
            row: Row = ours.recv()
            process.join()
            return row
    except EOFError:
        process.join()
        code = process.exitcode or 0
        if code == -signal.SIGXCPU:
            return {"status": "timeout", "message": f"more than {CPU_S} s of CPU time"}
        return {"status": "died", "message": signal.Signals(-code).name if code < 0 else f"exit status {code}"}
    process.kill()
    process.join()
    return {"status": "timeout", "message": f"no answer after {WALL_S} s"}


def _answer(pipe: Connection, one: Set, name: str, places: Places) -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (CPU_S, CPU_S + 10))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    meter = Meter()
    row = one.measure(name, places, meter)
    pipe.send({**row, **meter.figures})
