"""Progress bars, and how a command ends."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import typer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from anglecam.cli.json_output import report
from anglecam.errors import AnglecamError, RigError
from anglecam.terminal import errors

QUIET_S = 20.0
"""Least time between two lines about the stage of a computation, s."""


@contextmanager
def progress_bars() -> Iterator[Progress]:
    """Show progress bars on standard error while the block runs, on a terminal only."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=errors, disable=not errors.is_terminal) as bars:
        yield bars


@contextmanager
def stages() -> Iterator[Callable[[str], None]]:
    """Show the stage of a long computation on standard error while the block runs.

    Yields
    ------
    callable
        Takes the name of each stage as it begins. Without a terminal a name is a line, at most one in `QUIET_S`, so
        that a short computation prints nothing.
    """
    with progress_bars() as bars:
        bar, began = bars.add_task("", total=None), time.monotonic()
        printed = began

        def begin(stage: str) -> None:
            nonlocal printed
            bars.update(bar, description=stage)
            now = time.monotonic()
            if not errors.is_terminal and now - printed >= QUIET_S:
                printed = now
                errors.print(f"after {now - began:.0f} s: {stage}")

        yield begin
        bars.update(bar, description="done", completed=1, total=1)


def tell(problems: Sequence[AnglecamError]) -> None:
    """Print what went wrong, a line each; a fault of a rig file that several clips share is printed once."""
    lines = list(dict.fromkeys(line for problem in problems for line in problem.args))
    for line in lines:
        errors.print(line)
    report(problems=lines)


def leave(problems: Sequence[AnglecamError]) -> None:
    """Leave with the contract's exit status."""
    if problems:
        raise typer.Exit(2 if any(isinstance(p, RigError) for p in problems) else 1)


def end(problems: Sequence[AnglecamError]) -> None:
    """Print what went wrong and leave with the contract's exit status."""
    tell(problems)
    leave(problems)
