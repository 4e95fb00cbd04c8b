"""What a batch costs beyond measuring, what a second job gains, and what 20 kills leave behind.

    PYTHONPATH=tests .venv/bin/python benchmarks/batch.py [clips] [kills]

Films: thirty frames of a nodding head, 320 × 240, ten of them under many names. All are measured by a batch with one
job and by a batch with two; sixty also by a bare loop in one process (one thread, as the batch's jobs have)
and by batches of their own, one of them unbroken and one killed again and again.

- Gain: wall time with two jobs over that with one.
- Overhead: wall time × jobs less the sum of the clips' wall times, as a share of wall time × jobs; and a clip's part of
  wall time with one job over that in the bare loop, less one. Both include starting Python and writing the index.
- Memory: the batch's own resident size when a tenth, half and all of the clips are done, its measuring processes apart.
- Kills: a batch with two jobs is killed (SIGKILL, in turn the batch itself and first one of its measuring processes) at
  instants drawn evenly over the time that an unbroken one takes, and started again with `--retry-failed` until it has
  come to its end; every file that it has then left is compared, byte by byte, with the unbroken one's, wall times
  apart, and it begins anew, until it has been killed often enough.
"""

from __future__ import annotations

import csv
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np

from support.drawn import RATE_HZ, Look, draw_frames
from support.tiny import batch_command, children, is_alive, results, unfinished

CLIPS, FEW, KILLS = 1_000, 60, 20
SIZE, FRAMES, FILMS = (320, 240), 30, 10
SINGLE = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "NUMBA")}

BARE = """
import sys, cv2
from pathlib import Path
from anglecam.video.film import open_film
from anglecam.measurement.clip import measure_clip
from anglecam.workflow.clip import write_measurement
from anglecam.io.session import rig_beside
cv2.setNumThreads(1)
for clip in sorted(Path(sys.argv[1]).glob("*.avi")):
    write_measurement(measure_clip(open_film(clip), rig_beside(clip)), None, Path(sys.argv[2]))
"""


def film(folder: Path, clips: int) -> Path:
    """Draw ten films and give them many names."""
    folder.mkdir()
    for k in range(FILMS):
        path = folder / f"{k:04d}.avi"
        writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), RATE_HZ, SIZE)
        angles = 10 * np.sin(np.arange(FRAMES) / 5 + k)
        for frame in draw_frames(Look(marker="ring"), angles, seed=k):
            writer.write(cv2.resize(frame, SIZE, interpolation=cv2.INTER_AREA))
        writer.release()
    for k in range(FILMS, clips):
        shutil.copy(folder / f"{k % FILMS:04d}.avi", folder / f"{k:04d}.avi")
    return folder


def bare(lab: Path, out: Path) -> float:
    """Return the time that a plain loop takes, s."""
    began = time.perf_counter()
    subprocess.run([sys.executable, "-c", BARE, lab, out], check=True, env=os.environ | SINGLE)
    return time.perf_counter() - began


def batch(lab: Path, out: Path, jobs: int) -> tuple[float, list[float]]:
    """Return the time that a batch takes, s, and its resident sizes, MB, as it goes on."""
    clips, sizes = len(list(lab.iterdir())), []
    began = time.perf_counter()
    running = subprocess.Popen(batch_command(lab, "--out", out, "--jobs", jobs, "--quiet"))
    due = [0.1 * clips, 0.5 * clips, clips]
    while running.poll() is None:
        size = resident_mb(running.pid)
        notes = out / ".anglecam" / "clips"
        if due and notes.exists() and sum(1 for _ in os.scandir(notes)) >= due[0]:
            due.pop(0)
            sizes.append(size)
        time.sleep(0.2)
    took = time.perf_counter() - began
    if running.returncode != 0:
        raise SystemExit(f"the batch ended with status {running.returncode}")
    return took, sizes


def resident_mb(pid: int) -> float:
    """Return a process's resident size."""
    try:
        status = Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return float("nan")
    found = [line for line in status.splitlines() if line.startswith("VmRSS")]
    return int(found[0].split()[1]) / 1024 if found else float("nan")


def overhead(out: Path, took: float, jobs: int) -> float:
    """Return the share of the jobs' time in which no clip was being worked on."""
    with (out / "index.csv").open() as stream:
        busy = sum(float(row["wall_time_s"]) for row in csv.DictReader(stream))
    return (took * jobs - busy) / (took * jobs)


def killed_and_resumed(lab: Path, unbroken: Path, out: Path, kills: int, span: float) -> str:
    """Kill a batch again and again, let it come to its end, and say what it has left."""
    rng, expected = random.Random(7), results(unbroken)
    hit = ends = 0
    differing: set[str] = set()
    while hit < kills or out.exists():
        patience = rng.uniform(0.0, span) if hit < kills else None
        running = subprocess.Popen(batch_command(lab, "--out", out, "--jobs", 2, "--quiet", "--retry-failed"))
        try:
            status = running.wait(patience)
        except subprocess.TimeoutExpired:
            kill(running, worker_first=bool(hit % 2), rng=rng)
            hit += 1
            continue
        found = results(out)
        differing |= {name for name in found.keys() | expected.keys() if found.get(name) != expected.get(name)}
        differing |= set(unfinished(out)) | ({f"status {status}"} if status else set())
        ends += 1
        shutil.rmtree(out)
    same = "each time the same byte by byte" if not differing else f"differing: {', '.join(sorted(differing)[:5])}"
    return f"{hit} kills, after which it came to its end {ends} times; {len(expected)} files, {same}"


def kill(running: subprocess.Popen[bytes], *, worker_first: bool, rng: random.Random) -> None:
    """Kill a batch, before it perhaps one of its measuring processes, and wait until all of it is gone."""
    workers = children(running.pid)
    if worker_first and workers:
        os.kill(rng.choice(workers), signal.SIGKILL)
        time.sleep(rng.uniform(0.0, 0.2))
    workers = children(running.pid)
    running.kill()
    running.wait()
    while any(map(is_alive, workers)):
        time.sleep(0.01)


def main() -> None:
    """Run all of it and print a table."""
    clips = int(sys.argv[1]) if len(sys.argv) > 1 else CLIPS
    kills = int(sys.argv[2]) if len(sys.argv) > 2 else KILLS
    with tempfile.TemporaryDirectory() as folder:
        top = Path(folder)
        lab, few = film(top / "lab", clips), film(top / "few", min(clips, FEW))
        plain = bare(few, top / "bare") / min(clips, FEW)
        one, _ = batch(lab, top / "one", 1)
        two, sizes = batch(lab, top / "two", 2)
        print(f"{clips} clips of {FRAMES} frames, {SIZE[0]} × {SIZE[1]}; {os.cpu_count()} cores")
        print(f"bare loop {plain:.2f} s a clip; one job {one:.0f} s; two jobs {two:.0f} s: {two / one:.2f} × one job")
        print(f"overhead by the clips' own wall times: {overhead(top / 'one', one, 1):.1%} with one job, ", end="")
        print(f"{overhead(top / 'two', two, 2):.1%} with two; over the bare loop {one / clips / plain - 1.0:.1%}")
        print(f"memory when a tenth, half, all are done: {', '.join(f'{size:.0f}' for size in sizes)} MB")
        span, _ = batch(few, top / "unbroken", 2)
        print(killed_and_resumed(few, top / "unbroken", top / "killed", kills, span))


if __name__ == "__main__":
    main()
