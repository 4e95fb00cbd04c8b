"""How time and memory of `identify` and `close` grow with the number of samples.

    .venv/bin/python -m benchmarks.long_series [longest]

A session is two series of equal length at 100 Hz, one of them held out, of a plant that follows levels of random height
and length 40 ms late. The plant is discretised exactly for a command that is held between samples. Each row is of one
fresh process; its memory is the highest resident size.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from datetime import date
from pathlib import Path

import numpy as np
from scipy.signal import cont2discrete, lfilter

from anglecam.data.series import AngleSeries
from anglecam.io.series_csv import write_series

LENGTHS = (10_000, 30_000, 100_000, 1_000_000)
"""Samples of both series."""
RATE_HZ = 100.0
A, B, C = 26.0, 524.0, 508.0
"""1/s, 1/s², 1/s²: the paper's neck."""
DELAY = 4
"""Samples."""
SIGMA = np.radians(0.05)
COMMAND = [sys.executable, "-c", "from anglecam.cli.app import main; main()"]


def write_session(folder: Path, samples: int) -> Path:
    """Write a session of this number of samples."""
    folder.mkdir()
    numerator, denominator, _ = cont2discrete(([C], [1.0, A, B]), 1.0 / RATE_HZ)
    for seed, name in enumerate(("fitted", "held_out")):
        rng, n = np.random.default_rng(seed), samples // 2
        starts = np.cumsum(rng.integers(40, 90, n // 40))
        starts = np.concatenate([[0], starts[starts < n]])
        levels = np.concatenate([[0.0], rng.uniform(-12.0, 12.0, len(starts) - 1)])
        command = levels[np.searchsorted(starts, np.arange(n), side="right") - 1]
        late = np.concatenate([np.zeros(DELAY), command[:-DELAY]])
        angle = np.radians(lfilter(numerator.ravel(), denominator, late)) + SIGMA * rng.standard_normal(n)
        series = AngleSeries(name, np.arange(n) / RATE_HZ, angle, np.full(n, SIGMA), ("ok",) * n)
        write_series(series, folder / f"{name}.angles.csv")
        rows = np.column_stack([starts / RATE_HZ, levels])
        header = "time_s,command_deg"
        np.savetxt(folder / f"{name}.command.csv", rows, "%.6f", ",", header=header, comments="")
    (folder / "rig.yaml").write_text("held_out: [held_out]\n")
    return folder


def run(verb: str, session: Path, out: Path) -> tuple[int, float, float, float, str]:
    """Return exit status, wall time, CPU time, s, highest resident size, MB, and the last line on standard error."""
    began = time.perf_counter()
    errors = out.with_suffix(".err")
    with errors.open("w") as stream:
        command = [*COMMAND, verb, str(session), "--out", str(out)]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=stream)
        _, status, used = os.wait4(process.pid, 0)
    lines = errors.read_text().splitlines()
    wall, cpu = time.perf_counter() - began, used.ru_utime + used.ru_stime
    return os.waitstatus_to_exitcode(status), wall, cpu, used.ru_maxrss * 1024 / 1e6, lines[-1] if lines else ""


def main(longest: int) -> None:
    """Print the table."""
    print(f"{date.today():%d %B %Y}\n")
    print("| samples | command | exit status | wall, s | CPU, s | memory, MB | last line |\n|" + " --- |" * 7)
    with tempfile.TemporaryDirectory() as name:
        top = Path(name)
        sessions = {n: write_session(top / f"{n}", n) for n in LENGTHS if n <= longest}
        for verb in ("identify", "close"):
            for samples, session in sessions.items():
                status, wall, cpu, memory, line = run(verb, session, top / f"{verb}{samples}")
                line = line.replace(str(session), "SESSION")
                print(
                    f"| {samples:,} | {verb} | {status} | {wall:.0f} | {cpu:.0f} | {memory:.0f} | {line} |", flush=True
                )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else LENGTHS[-1])
