"""Progress bars, and how a command ends."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import typer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from anglecam.cli.json_output import report
from anglecam.errors import AnglecamError, RigError
from anglecam.terminal import errors


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


def end(problems: Sequence[AnglecamError]) -> None:
    """Print what went wrong, a line each, and leave with the contract's exit status.

    A fault of a rig file that several clips share is printed once.
    """
    lines = list(dict.fromkeys(line for problem in problems for line in problem.args))
    for line in lines:
        errors.print(line)
    report(problems=lines)
    if problems:
        raise typer.Exit(2 if any(isinstance(p, RigError) for p in problems) else 1)
