"""Clips that take a few hundred milliseconds to measure, for tests of many clips, in which the angles do not matter."""

from __future__ import annotations

import csv
import io
import os
import subprocess
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from pyarrow import parquet

from .drawn import RATE_HZ, Look, draw_frames

SIZE = (160, 120)
FRAMES = 8


def tiny_clip(path: Path, seed: int = 0) -> Path:
    """Write eight frames of a moving body, a quarter of the usual size; every seed gives a different clip."""
    path.parent.mkdir(parents=True, exist_ok=True)
    plain = path.with_name("plain.avi")  # OpenCV does not accept every name
    writer = cv2.VideoWriter(str(plain), cv2.VideoWriter_fourcc(*"MJPG"), RATE_HZ, SIZE)
    for frame in _frames(seed % 5):
        shade = np.full_like(frame, seed // 5)
        writer.write(cv2.add(frame, shade))
    writer.release()
    return plain.replace(path)


def tiny_lab(folder: Path, names: Sequence[str]) -> Path:
    """Write tiny clips, each with different content."""
    for seed, name in enumerate(names):
        tiny_clip(folder / name, seed)
    return folder


@cache
def _frames(seed: int) -> tuple[np.ndarray, ...]:
    angles = 20 * np.cos(np.pi * np.arange(FRAMES) / (FRAMES - 1)) + seed
    drawn = draw_frames(Look(marker="ring"), angles, seed=seed)
    return tuple(cv2.resize(frame, SIZE, interpolation=cv2.INTER_AREA) for frame in drawn)


def batch_command(*arguments: object) -> list[str]:
    """Return the command line of a batch."""
    return [sys.executable, "-c", "from anglecam.cli.app import main; main()", "batch", *map(str, arguments)]


def run_batch(*arguments: object, **options: object) -> subprocess.CompletedProcess[str]:
    """Run a batch as a user does, and wait for its end."""
    return subprocess.run(
        batch_command(*arguments), capture_output=True, text=True, timeout=300, check=False, **options
    )


def results(out: Path) -> dict[str, bytes]:
    """Return every file that a batch has written for the user, by its path; the index without its wall times."""
    found = {}
    for path in sorted(out.rglob("*")):
        inside = path.relative_to(out)
        if path.is_file() and inside.parts[0] != ".anglecam":
            found[str(inside)] = path.read_bytes()
    found["index.csv"] = b"\n".join(_without_wall_time(found["index.csv"]))
    if "index.parquet" in found:  # too large for a disk that is nearly full
        table = parquet.read_table(io.BytesIO(found["index.parquet"]))
        found["index.parquet"] = repr(table.drop_columns("wall_time_s").to_pydict()).encode()
    return found


def unfinished(out: Path) -> list[str]:
    """Return the names of unfinished files that a batch has left behind."""
    return [p.name for p in out.rglob("*") if p.is_file() and ("unfinished" in p.parts or p.name.startswith("."))]


def children(pid: int) -> list[int]:
    """Return the ids of the processes that a process has started."""
    threads = Path(f"/proc/{pid}/task").iterdir()
    return [int(child) for thread in threads for child in _text_of(thread / "children").split()]


def command_line(pid: int) -> str:
    """Return a process's command line; an empty string if the process is gone."""
    return _text_of(Path(f"/proc/{pid}/cmdline"))


def _text_of(path: Path) -> str:
    """Return the text of a file about a process or a thread; an empty string if that has ended."""
    try:
        return path.read_text()
    except (ProcessLookupError, FileNotFoundError):
        return ""


def is_alive(pid: int) -> bool:
    """Return whether a process exists and is not a zombie."""
    try:
        os.kill(pid, 0)
        return ") Z " not in Path(f"/proc/{pid}/stat").read_text()
    except (ProcessLookupError, FileNotFoundError):
        return False


def _without_wall_time(table: bytes) -> list[bytes]:
    rows = list(csv.reader(io.StringIO(table.decode())))
    at = rows[0].index("wall_time_s")
    return [repr(row[:at] + row[at + 1 :]).encode() for row in rows]
