"""Measures the latency of `anglecam live`, and counts the frames that it cannot measure in time.

    .venv/bin/python -m benchmarks.live [seconds]

Films of random steps are played at their rate. A fresh process measures each, restricted to one core. The clips repeat
the packets of a short one: MJPEG's packets are independent, and a motion played forwards and backwards is continuous.
"Late" frames are those that were recorded but not measured, because their turn came more than 0.1 s late.
"""

from __future__ import annotations

import os
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from datetime import date
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from anglecam.io.rig import Rig
from anglecam.video.live_source import open_live
from anglecam.workflow.live import measure_live
from benchmarks.throughput import film, repeat

FILMS = {"640 × 480 at 100 Hz": ([640, 480], 100), "1920 × 1080 at 30 Hz": ([1920, 1080], 30)}
"""Size, px, and rate at which the film is played, Hz."""
SHORT_S = 5.0
"""Duration of the film whose packets are repeated, s."""


def play(clip: Path, out: Path) -> list[str]:
    """Measure a film while it is played, by one core; return the cells of the table."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    out.mkdir()
    result = measure_live(open_live(str(clip)), out, Rig(), None, lambda row, cause: None)
    latency = 1e3 * result.latencies
    counts = [result.count(status) for status in ("learning", "ok", "late")]
    rest = len(result.rows) - sum(counts)
    median, most, worst = np.percentile(latency, [50, 95, 100]) if len(latency) else [np.nan] * 3
    figures = [f"{median:.1f}", f"{most:.1f}", f"{worst:.0f}", f"{result.disagreement:.2f}"]
    return [str(count) for count in (len(result.rows), *counts, rest)] + figures


def alone(clip: Path, out: Path) -> list[str]:
    """Do the same in a fresh process, so that kernels are loaded and nothing is learnt before."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(play, clip, out).result()


def main(seconds: float) -> None:
    print(f"{date.today():%d %B %Y}, one core, {seconds:g} s of each film\n")
    print("| film | frames | learning | ok | late | other | median ms | 95 % ms | most ms | off the recording, σ |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for title, (size, rate) in FILMS.items():
            short, _ = film(folder / f"{rate}", {"size": size, "codec": "mjpeg", "fps": rate}, SHORT_S)
            clip = repeat(short, round(seconds * rate), folder / f"{rate}.avi")
            alone(short, folder / f"{rate} warm")  # kernels are compiled at first use
            print(f"| {title} | {' | '.join(alone(clip, folder / f'{rate} out'))} |", flush=True)


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 30.0)
