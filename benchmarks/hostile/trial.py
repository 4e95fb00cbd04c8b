"""Run `anglecam measure` on a film as a user would, and compare what it states with the truth."""

from __future__ import annotations

import contextlib
import io
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.hostile.draw import Film, write

HONEST = 2.0
"""Largest RMS of error over sigma that counts as honest."""
FAR, FEW = 4.0, 0.01
"""Rows with an error beyond so many sigma are far off; at most this share of them is honest."""
WORTHLESS = 0.1
"""Share of the true motion, RMS, from which on an error is too large to be excused by a large sigma."""


@dataclass(frozen=True)
class Outcome:
    """What became of one film."""

    name: str
    status: int
    """Exit status."""
    rows: int
    ok: int
    line: str
    """Last line on standard error."""
    error_deg: float = float("nan")
    """RMS over the rows that are ok, the mean subtracted: neutral is arbitrary."""
    sigma_deg: float = float("nan")
    ratio: float = float("nan")
    """RMS of error over sigma."""
    far: float = 0.0
    """Share of the ok rows whose error exceeds `FAR` sigma."""
    lost: float = 0.0
    """RMS error as a share of the RMS of the true motion."""
    seconds: float = 0.0

    @property
    def silent(self) -> bool:
        """Whether no row is ok, and the exit status says so."""
        return self.ok == 0 and self.status == 1 and "internal error" not in self.line

    @property
    def honest(self) -> bool:
        """Whether all rows that are ok are right within their sigma."""
        right = self.ratio <= HONEST and self.far <= FEW and self.lost <= WORTHLESS
        return self.silent or (self.ok > 0 and right)


def run(film: Film, folder: Path) -> Outcome:
    """Write a film, measure it by the command line, and judge the result."""
    return measured(film, write(film, folder))


def measured(film: Film, path: Path) -> Outcome:
    """Measure a film that was written to ``path`` by the command line, judge the result, and delete the film."""
    from anglecam.cli.app import main

    out, said = path.parent / "out", io.StringIO()
    began, arguments, status = time.monotonic(), sys.argv, 0
    sys.argv = ["anglecam", "measure", str(path), "--out", str(out)]
    try:
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
            main()
    except SystemExit as end:
        status = int(end.code or 0)
    finally:
        sys.argv = arguments
    seconds = time.monotonic() - began
    lines = [text for text in said.getvalue().splitlines() if text.strip()]
    line = lines[-1].replace(f"{path}: ", "") if lines else ""
    series = out / f"{film.name}.angles.csv"
    outcome = _judged(film, status, line, series, seconds)
    path.unlink()
    return outcome


def _judged(film: Film, status: int, line: str, series: Path, seconds: float) -> Outcome:
    if not series.exists():
        return Outcome(film.name, status, 0, 0, line, seconds=seconds)
    rows = np.genfromtxt(series, delimiter=",", names=True, dtype=None, encoding="utf-8")
    ok = rows["status"] == "ok"
    plain = Outcome(film.name, status, len(rows), int(ok.sum()), line, seconds=seconds)
    if film.angle_deg is None or not ok.any():
        return plain
    error = (rows["angle_deg"] - film.angle_deg[: len(rows)])[ok]
    sigma = rows["sigma_deg"][ok]
    error = error - np.median(error)
    return Outcome(
        film.name,
        status,
        len(rows),
        int(ok.sum()),
        line,
        float(np.sqrt((error**2).mean())),
        float(np.median(sigma)),
        float(np.sqrt(((error / sigma) ** 2).mean())),
        float((np.abs(error) > FAR * sigma).mean()),
        float(error.std() / film.angle_deg.std()),
        seconds,
    )
