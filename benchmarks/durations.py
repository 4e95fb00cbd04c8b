"""Writes how long the tests take, by folder, and which take longest, to ``benchmarks/durations.md``.

    .venv/bin/python -m pytest --durations=0 --junitxml=build/tests.xml
    .venv/bin/python -m benchmarks.durations COMMIT=build/tests.xml [COMMIT=FILE ...]

Each run, named by its commit, is a column; the longest tests are listed for each run.
"""

from __future__ import annotations

import sys
from pathlib import Path

from anglecam.io.files import write_atomically
from benchmarks.junit import Run, read_junit, seconds_by

OUT = Path(__file__).with_suffix(".md")
LONGEST = 60


def main() -> None:
    """Write the page."""
    runs = {name: read_junit(Path(path)) for name, path in (said.split("=", 1) for said in sys.argv[1:])}
    with write_atomically(OUT) as stream:
        stream.write(page(runs))


def page(runs: dict[str, Run]) -> str:
    """Return the page for runs by their commits."""
    return "\n".join(
        [
            "# How long the tests take",
            "",
            "Written by `benchmarks/durations.py` from pytest's JUnit files. Seconds are those of a clock in two",
            "processes, with the fixtures that a test sets up, and grow with whatever else the machine does.",
            "",
            *_runs(runs),
            *_folders(runs),
            *(line for name, run in runs.items() for line in _longest(name, run)),
        ]
    )


def _runs(runs: dict[str, Run]) -> list[str]:
    rows = [
        (name, run.began.replace("T", " "), str(len(run.tests)), f"{run.seconds:.0f}", f"{_total(run):.0f}")
        for name, run in runs.items()
    ]
    return _table(("commit", "began", "tests", "from start to end, s", "sum over tests, s"), rows)


def _folders(runs: dict[str, Run]) -> list[str]:
    sums = [seconds_by([test.folder for test in run.tests], run.tests) for run in runs.values()]
    names = dict.fromkeys(name for one in sums for name in one)
    rows = [(name, *(f"{one.get(name, 0.0):.1f}" for one in sums)) for name in names]
    return _table(("folder, s", *runs), rows)


def _longest(name: str, run: Run) -> list[str]:
    rows = [(f"{test.seconds:.1f}", f"`{test.name.removeprefix('tests/')}`") for test in run.tests[:LONGEST]]
    return [f"## The {LONGEST} longest of {name}", "", *_table(("s", "test"), rows)]


def _total(run: Run) -> float:
    return sum(test.seconds for test in run.tests)


def _table(header: tuple[str, ...], rows: list[tuple[str, ...]]) -> list[str]:
    lines = [header, ("---",) * len(header), *rows]
    return [*(f"| {' | '.join(cell.replace('|', '¦') for cell in line)} |" for line in lines), ""]


if __name__ == "__main__":
    main()
