"""The command `doctor`: check whether anglecam can work on this machine."""

from __future__ import annotations

from dataclasses import asdict

from rich.table import Table

from anglecam.cli.json_output import report
from anglecam.cli.progress import begin_loading, end, stages
from anglecam.errors import InputError
from anglecam.terminal import screen


def doctor() -> None:
    """Check this machine: versions, codecs, threads, kernel cache, memory, disk, and a film with a known angle."""
    table = Table("check", "found")
    problems = []
    with stages() as progress:
        begin_loading(progress)
        from anglecam.workflow.doctor import checks

        for check in checks(progress):
            table.add_row(check.name, check.found)
            report(checks=[asdict(check)])
            if check.problem is not None:
                problems.append(InputError(check.problem))
    screen.print(table)
    end(problems)
