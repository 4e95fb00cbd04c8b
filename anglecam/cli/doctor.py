"""The command `doctor`: check whether anglecam can work on this machine."""

from __future__ import annotations

from dataclasses import asdict

from rich.table import Table

from anglecam.cli.json_output import report
from anglecam.cli.progress import end
from anglecam.errors import InputError
from anglecam.terminal import errors, screen


def doctor() -> None:
    """Check this machine: versions, codecs, threads, kernel cache, memory, disk, and a film with a known angle."""
    from anglecam.workflow.doctor import checks

    table = Table("check", "found")
    problems = []
    if errors.is_terminal:
        errors.print("measuring a drawn film; the first time, kernels are compiled for up to a minute")
    for check in checks():
        table.add_row(check.name, check.found)
        report(checks=[asdict(check)])
        if check.problem is not None:
            problems.append(InputError(check.problem))
    screen.print(table)
    end(problems)
