"""The overhead of a batch, the gain of a second job, and the state of the results after 20 kills.

    PYTHONPATH=tests .venv/bin/python benchmarks/batch.py [clips] [kills]
    PYTHONPATH=tests .venv/bin/python benchmarks/batch.py sessions [kills]

The clips have thirty frames each, 320 × 240, of a body that turns about its pivot. Ten different clips are copied under
many names. A batch with one job and a batch with two jobs measure all of them. Sixty are also measured by a plain
loop in one process (with one thread, as in the batch), by a batch that is not killed, and by one that is killed
repeatedly.

- Gain: wall time with two jobs divided by wall time with one job.
- Overhead: wall time × jobs minus the sum of the clips' wall times, as a share of wall time × jobs; and wall time per
  clip with one job divided by that of the plain loop, minus one. Both include starting Python and writing the index.
- Memory: resident size of the batch's process, without its measuring processes, when a tenth, half and all of the clips
  are done.
- Kills: a batch with two jobs is killed with SIGKILL at random instants, uniformly distributed over the CPU time that a
  batch takes without kills, so that other work on the machine does not move them towards the start. Every second time,
  one of its measuring processes is killed first. The batch is repeated with `--retry-failed` until it ends by itself.
  All its files, except for wall times, are then compared byte by byte with those of the batch that was not killed. This
  is repeated until the number of kills is reached.
- Processes: after each kill, the time until the last process that the batch had started is gone. One that is left
  after five seconds is counted.
- Sessions: the same kills of a batch with ``--close`` of two sessions, each of two series and a tiny clip.
"""

from __future__ import annotations

import csv
import math
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
from support.tiny_session import tiny_session

CLIPS, FEW, KILLS = 1_000, 60, 20
PATIENCE_S = 5.0
"""Time after a kill in which every process of the batch must be gone."""
SIZE, FRAMES, DIFFERENT = (320, 240), 30, 10
SINGLE = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "NUMBA")}

PLAIN_LOOP = """
import sys, cv2
from pathlib import Path
from anglecam.video.open_film import open_film
from anglecam.measurement.clip import measure_clip
from anglecam.workflow.clip import write_measurement
from anglecam.io.session import rig_beside
cv2.setNumThreads(1)
for clip in sorted(Path(sys.argv[1]).glob("*.avi")):
    write_measurement(measure_clip(open_film(clip), rig_beside(clip)), None, Path(sys.argv[2]))
"""


def make_clips(folder: Path, clips: int) -> Path:
    """Draw ten clips and copy them under many names."""
    folder.mkdir()
    for k in range(DIFFERENT):
        path = folder / f"{k:04d}.avi"
        writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), RATE_HZ, SIZE)
        angles = 10 * np.sin(np.arange(FRAMES) / 5 + k)
        for frame in draw_frames(Look(marker="ring"), angles, seed=k):
            writer.write(cv2.resize(frame, SIZE, interpolation=cv2.INTER_AREA))
        writer.release()
    for k in range(DIFFERENT, clips):
        shutil.copy(folder / f"{k % DIFFERENT:04d}.avi", folder / f"{k:04d}.avi")
    return folder


def plain_loop(lab: Path, out: Path) -> float:
    """Return the time that a plain loop takes, in s."""
    began = time.perf_counter()
    subprocess.run([sys.executable, "-c", PLAIN_LOOP, lab, out], check=True, env=os.environ | SINGLE)
    return time.perf_counter() - began


def batch(lab: Path, out: Path, jobs: int) -> tuple[float, list[float]]:
    """Return the time that a batch takes, in s, and its resident sizes on the way, in MB."""
    clips, sizes = len(list(lab.iterdir())), []
    began = time.perf_counter()
    running = subprocess.Popen(batch_command(lab, "--out", out, "--jobs", jobs, "--quiet"))
    due = [0.1 * clips, 0.5 * clips, clips]
    while running.poll() is None:
        size = resident_mb(running.pid)
        if due and len(list(out.glob("*.angles.csv"))) >= due[0]:
            due.pop(0)
            sizes.append(size)
        time.sleep(0.2)
    took = time.perf_counter() - began
    if running.returncode != 0:
        raise SystemExit(f"the batch ended with status {running.returncode}")
    return took, sizes


def resident_mb(pid: int) -> float:
    """Return a process's resident size, in MB."""
    try:
        status = Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return float("nan")
    found = [line for line in status.splitlines() if line.startswith("VmRSS")]
    return int(found[0].split()[1]) / 1024 if found else float("nan")


def overhead(out: Path, took: float, jobs: int) -> float:
    """Return the share of the jobs' time in which no clip was under way."""
    with (out / "index.csv").open() as stream:
        busy = sum(float(row["wall_time_s"]) for row in csv.DictReader(stream))
    return (took * jobs - busy) / (took * jobs)


def killed_and_resumed(lab: Path, unbroken: Path, out: Path, kills: int, span: float, *options: str) -> str:
    """Kill a batch repeatedly, let it end by itself, and return how its files compare; ``span`` is CPU time, in s."""
    rng, expected = random.Random(7), results(unbroken)
    ends, gone_after = 0, []
    differing: set[str] = set()
    while len(gone_after) < kills or out.exists():
        limit = rng.uniform(0.0, span) if len(gone_after) < kills else math.inf
        command = batch_command(lab, "--out", out, "--jobs", 2, "--quiet", "--retry-failed", *options)
        running = subprocess.Popen(command, stderr=subprocess.DEVNULL)
        spent = run_until(running, limit)
        if running.returncode is None:
            gone_after.append(kill(running, worker_first=bool(len(gone_after) % 2), rng=rng))
            done = len(list(out.rglob("*.angles.csv"))), len(list(out.rglob("loop.json")))
            print(
                f"kill {len(gone_after)} after {spent:.1f} s of CPU time, {done[0]} clips and {done[1]} loops in place",
                flush=True,
            )
            continue
        found, status = results(out), running.returncode
        differing |= {name for name in found.keys() | expected.keys() if found.get(name) != expected.get(name)}
        differing |= set(unfinished(out)) | ({f"status {status}"} if status != (1 if options else 0) else set())
        ends += 1
        print(f"ended by itself with status {status}; {len(differing)} files differ", flush=True)
        shutil.rmtree(out)
    same = "equal byte by byte each time" if not differing else f"differing: {', '.join(sorted(differing)[:5])}"
    left = sum(math.isinf(time) for time in gone_after)
    return (
        f"{len(gone_after)} kills, a process left after {PATIENCE_S:g} s: {left} times; "
        f"all gone after {max(gone_after, default=0.0):.2f} s at most; "
        f"the batch then ended by itself {ends} times; {len(expected)} files, {same}"
    )


def run_until(running: subprocess.Popen[bytes], limit: float) -> float:
    """Wait until a batch ends or its processes have spent this CPU time; return the time that was seen last, in s."""
    spent = 0.0
    while running.poll() is None and spent < limit:
        spent = max(spent, sum(map(cpu_seconds, (running.pid, *descendants(running.pid)))))
        time.sleep(0.02)
    return spent


def cpu_seconds(pid: int) -> float:
    """Return the CPU time of a process, in s; 0 if it is gone."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def kill(running: subprocess.Popen[bytes], *, worker_first: bool, rng: random.Random) -> float:
    """Kill a batch, with ``worker_first`` after one of its measuring processes.

    Returns
    -------
    float
        Time in s until the last of the processes below it is gone; infinite if one is left after `PATIENCE_S`.
    """
    workers = children(running.pid)
    if worker_first and workers:
        os.kill(rng.choice(workers), signal.SIGKILL)
        time.sleep(rng.uniform(0.0, 0.2))
    below = descendants(running.pid)
    running.kill()
    began = time.perf_counter()
    running.wait()
    while any(map(is_alive, below)):
        if time.perf_counter() - began > PATIENCE_S:
            return math.inf
        time.sleep(0.001)
    return time.perf_counter() - began


def descendants(pid: int) -> list[int]:
    """Return the ids of all processes below a process."""
    try:
        below = children(pid)
    except OSError:  # it has just ended
        return []
    return below + [process for child in below for process in descendants(child)]


def killed_sessions(top: Path, kills: int) -> None:
    """Print how a batch that closes loops survives being killed."""
    lab, unbroken = top / "lab", top / "unbroken"
    for seed, name in enumerate(("mon", "tue")):
        tiny_session(lab / name, seed, ("steps", "random"))
    for out in (top / "warm", unbroken):  # the first run compiles the kernels
        command = batch_command(lab, "--out", out, "--jobs", 2, "--quiet", "--close")
        span = run_until(subprocess.Popen(command, stderr=subprocess.DEVNULL), math.inf)
    same = "equal" if results(top / "warm") == results(unbroken) else "different"
    print(f"two sessions with --close: {span:.0f} s of CPU time; two undisturbed runs: {same} files", flush=True)
    print(killed_and_resumed(lab, unbroken, top / "killed", kills, span, "--close"))


def main() -> None:
    """Run the benchmark and print its figures."""
    if sys.argv[1:2] == ["sessions"]:
        with tempfile.TemporaryDirectory() as folder:
            killed_sessions(Path(folder), int(sys.argv[2]) if len(sys.argv) > 2 else KILLS)
        return
    clips = int(sys.argv[1]) if len(sys.argv) > 1 else CLIPS
    kills = int(sys.argv[2]) if len(sys.argv) > 2 else KILLS
    with tempfile.TemporaryDirectory() as folder:
        top = Path(folder)
        lab, few = make_clips(top / "lab", clips), make_clips(top / "few", min(clips, FEW))
        plain = plain_loop(few, top / "plain") / min(clips, FEW)
        one, _ = batch(lab, top / "one", 1)
        two, sizes = batch(lab, top / "two", 2)
        print(f"{clips} clips of {FRAMES} frames, {SIZE[0]} × {SIZE[1]}; {os.cpu_count()} cores")
        print(
            f"plain loop {plain:.2f} s per clip; one job {one:.0f} s; two jobs {two:.0f} s: {two / one:.2f} × one job"
        )
        print(f"overhead by the clips' wall times: {overhead(top / 'one', one, 1):.1%} with one job, ", end="")
        print(f"{overhead(top / 'two', two, 2):.1%} with two; over the plain loop {one / clips / plain - 1.0:.1%}")
        print(f"memory when a tenth, half, all are done: {', '.join(f'{size:.0f}' for size in sizes)} MB")
        command = batch_command(few, "--out", top / "unbroken", "--jobs", 2, "--quiet")
        span = run_until(subprocess.Popen(command), math.inf)
        print(killed_and_resumed(few, top / "unbroken", top / "killed", kills, span))


if __name__ == "__main__":
    main()
