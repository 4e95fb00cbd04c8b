"""The stored rows: one JSON file a set, one line a row, so that a change is one line of a diff."""

from __future__ import annotations

import json
import subprocess
from datetime import date
from pathlib import Path

from anglecam.io.files import write_atomically
from benchmarks.outcomes.case import Row, sha256

FOLDER = Path(__file__).parent
ROOT = FOLDER.parents[1]
CODE = ("anglecam", "pyproject.toml", "requirements")
"""What decides an outcome besides the film."""


def file_of(name: str) -> Path:
    """Return the file of a set's rows."""
    return FOLDER / f"{name}.json"


def read_rows(path: Path) -> dict[str, Row]:
    """Read rows by the names of their films; none where there is no file."""
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def write_rows(path: Path, rows: dict[str, Row]) -> None:
    """Write rows, so that a run that is killed leaves a complete file."""
    lines = [f"{json.dumps(name)}: {json.dumps(row)}" for name, row in rows.items()]
    path.parent.mkdir(parents=True, exist_ok=True)
    with write_atomically(path) as stream:
        stream.write("{\n" + ",\n".join(lines) + "\n}\n")


def origin() -> Row:
    """Return the date and the commit that last changed the code, with a hash of the files where they differ from it."""
    commit = _git("log", "-1", "--format=%h", "--abbrev=10", "--", *CODE)
    if _git("status", "--porcelain", "--", *CODE):
        listed = _git("ls-files", "--cached", "--others", "--exclude-standard", "--", *CODE).splitlines()
        commit += "+" + sha256(*(path for name in listed if (path := ROOT / name).exists()))[:8]
    return {"commit": commit, "date": f"{date.today()}"}


def _git(*arguments: str) -> str:
    command = ["git", "--no-optional-locks", *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()
