"""How the batch's own cost grows with the number of clips.

    .venv/bin/python -m benchmarks.batch_growth [most]

The clips are files of twelve bytes that no decoder opens, so that nearly all of the time is the batch's own: to search
folders, start jobs, record outcomes and write the index. Each size is run twice. The second run finds that nothing has
changed. Time and memory are those of the batch's process; its measuring process is counted in the wall time alone.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from datetime import date
from pathlib import Path

SIZES = (100, 1_000, 10_000, 100_000)
"""Clips."""
PER_FOLDER = 100
ANGLECAM = Path(sys.executable).with_name("anglecam")


def main(most: int) -> None:
    print(f"{date.today():%d %B %Y}\n")
    print("| clips | | wall, s | CPU, s | memory, MB | index.html, MB | index.csv, MB | database, MB |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for count in (size for size in SIZES if size <= most):
        with tempfile.TemporaryDirectory() as name:
            clips, out = Path(name) / "clips", Path(name) / "out"
            write_clips(clips, count)
            for run in ("new", "unchanged"):
                wall, cpu, memory = batch(clips, out)
                sizes = [
                    (out / file).stat().st_size / 1e6 for file in ("index.html", "index.csv", ".anglecam/batch.sqlite")
                ]
                figures = " | ".join(f"{size:.1f}" for size in sizes)
                print(f"| {count:,} | {run} | {wall:.1f} | {cpu:.1f} | {memory:.0f} | {figures} |", flush=True)


def write_clips(folder: Path, count: int) -> None:
    """Write files, each with other bytes, that look like the beginning of an AVI."""
    for number in range(count):
        inner = folder / f"{number // PER_FOLDER:04d}"
        inner.mkdir(parents=True, exist_ok=True)
        (inner / f"{number:06d}.avi").write_bytes(b"RIFF%08d" % number)


def batch(clips: Path, out: Path) -> tuple[float, float, float]:
    """Run a batch with one job; return wall time and CPU time, s, and the highest resident size, MB."""
    command = [ANGLECAM, "batch", clips, "--out", out, "--jobs", "1", "--quiet"]
    began = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, _, usage = os.wait4(process.pid, 0)
    process.returncode = 0  # it has been waited for
    return time.perf_counter() - began, usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024 / 1e6


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else SIZES[-2])
