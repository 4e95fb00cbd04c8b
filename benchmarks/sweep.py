"""Runs the claims at their full size, which ``make test`` leaves out, and keeps the result of the last run.

    .venv/bin/python -m benchmarks.sweep [FOLDER_OR_FILE ...]

Tests with the mark ``sweep`` are run. The result is written to ``benchmarks/sweep.json`` and into the section of
``benchmarks/README.md`` that shows it. With folders or files only their tests are run and nothing is written. The exit
status is pytest's.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from anglecam.io.files import write_atomically
from benchmarks.junit import Run, read_junit, seconds_by

ROOT = Path(__file__).resolve().parents[1]
JUNIT = ROOT / "build" / "sweep.xml"
RESULT = ROOT / "benchmarks" / "sweep.json"
README = ROOT / "benchmarks" / "README.md"
BEGIN, END = "<!-- sweep: written by benchmarks/sweep.py -->\n", "<!-- end of sweep -->\n"


def main() -> None:
    """Run the sweep, write its result if it is whole, and exit with pytest's status."""
    chosen = sys.argv[1:]
    JUNIT.parent.mkdir(exist_ok=True)
    command = [sys.executable, "-m", "pytest", "-m", "sweep", f"--junitxml={JUNIT}", *chosen]
    status = subprocess.run(command, cwd=ROOT, check=False).returncode
    if not chosen and status in (0, 1):
        result = summary(read_junit(JUNIT), commit())
        with write_atomically(RESULT) as stream:
            stream.write(json.dumps(result, indent=2) + "\n")
        text = with_table(README.read_text(encoding="utf-8"), result)
        with write_atomically(README) as stream:
            stream.write(text)
    sys.exit(status)


def summary(run: Run, commit: str) -> dict:
    """Return what ``sweep.json`` holds."""
    files = [test.name.split("::")[0] for test in run.tests]
    return {
        "date": run.began[:10],
        "commit": commit,
        **run.counts(),
        "seconds": round(run.seconds),
        "failures": sorted(test.name for test in run.tests if test.outcome == "failed"),
        "seconds_by_file": {name: round(s, 1) for name, s in seconds_by(files, run.tests).items()},
    }


def with_table(text: str, result: dict) -> str:
    """Return the README with the result between its two marks."""
    before, rest = text.split(BEGIN)
    after = rest.split(END)[1]
    columns = ("date", "commit", "passed", "failed", "xfailed", "skipped", "seconds")
    lines = [columns, ["---"] * len(columns), [str(result[column]) for column in columns]]
    table = "".join(f"| {' | '.join(line)} |\n" for line in lines)
    failures = "".join(f"- {name}\n" for name in result["failures"])
    return f"{before}{BEGIN}{table}" + (f"\n{failures}" if failures else "") + f"{END}{after}"


def commit() -> str:
    """Return the commit that is checked out, with a + where files differ from it."""
    said = ["git", "describe", "--always", "--dirty=+", "--abbrev=7", "--exclude=*"]
    return subprocess.run(said, cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()


if __name__ == "__main__":
    main()
