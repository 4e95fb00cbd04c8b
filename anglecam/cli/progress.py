"""Progress on a terminal, and how a command ends."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import typer
from rich.progress import BarColumn, SpinnerColumn, TaskID, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bars

from anglecam.cli.json_output import report
from anglecam.errors import AnglecamError, RigError, printable
from anglecam.prepare import prepare_kernels
from anglecam.progress import Progress, Stage
from anglecam.terminal import errors

QUIET_S = 20.0
"""Least time between two lines about the stage of a computation, s."""


@contextmanager
def progress_bars() -> Iterator[Bars]:
    """Show what is being done on standard error while the block runs, on a terminal only."""
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[count]}"),
        TimeElapsedColumn(),
    )
    # tables that are printed meanwhile go to standard output, also where that is a file
    with Bars(
        *columns,
        console=errors,
        disable=not errors.is_terminal,
        transient=True,
        redirect_stdout=sys.stdout.isatty(),
    ) as bars:
        yield bars


@contextmanager
def stages(*, lines: bool = False) -> Iterator[Progress]:
    """Show the stage of a long computation, and how far it is, while the block runs.

    Parameters
    ----------
    lines : bool
        Whether, without a terminal, the name of a stage is a line: at most one in `QUIET_S`, so that a short
        computation prints nothing.

    Yields
    ------
    Progress
        Takes each stage.
    """
    with progress_bars() as bars:
        yield _Shown(bars, lines=lines).show


def begin_loading(progress: Progress) -> None:
    """Begin what every command does before it measures or fits: its libraries take a second or more to load.

    On a new machine the numerical kernels are compiled first.
    """
    prepare_kernels("anglecam")
    progress(Stage("loading"))


class _Shown:
    """The stage that is shown."""

    def __init__(self, bars: Bars, *, lines: bool) -> None:
        self._bars, self._lines = bars, lines
        self._began = self._printed = time.monotonic()
        self._title: str | None = None
        self._bar: TaskID | None = None
        self._start = bars.get_time()

    def show(self, stage: Stage) -> None:
        """Show a stage, and the time since the first one began."""
        title = printable(stage.title)
        if self._bar is None or title != self._title:
            self._title = title
            if self._bar is not None:
                self._bars.remove_task(self._bar)  # a task cannot go back to a total that is not known
            self._bar = self._bars.add_task(title, total=stage.total, count="")
            self._bars.tasks[-1].start_time = self._start
            self._print(title)
        count = "" if stage.total is None else f"{stage.done} of {stage.total}"
        self._bars.update(self._bar, completed=stage.done, count=count)

    def _print(self, title: str) -> None:
        now = time.monotonic()
        if self._lines and not errors.is_terminal and now - self._printed >= QUIET_S:
            self._printed = now
            errors.print(f"after {now - self._began:.0f} s: {title}")


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
