"""How the cost of measuring and of closing the loop grows, with fitted exponents.

    .venv/bin/python -m benchmarks.growth [longest]

Each row is one run in a fresh process after one that loads the kernels; its CPU time is that of all threads. The
exponent is the slope of the logarithm of the CPU time over that of the size, by least squares; a constant part, such as
learning the body, makes it smaller than that of the part that grows. Long clips repeat the packets of a short one.
Recordings are copies of one session with other noise. Samples are those of all recordings.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from datetime import date
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from anglecam.loop.close import close_records
from benchmarks.blind.sessions import session
from benchmarks.throughput import cost, film, measure, repeat

LENGTHS = (100, 1_000, 10_000, 100_000)
"""Frames."""
SIZES = ([320, 240], [640, 480], [1280, 960], [1920, 1440])
"""px."""
SESSIONS = (1, 2, 4)
"""Sessions of five recordings that are closed together."""
RATES_HZ = (30.0, 60.0, 120.0)
"""Frame rates of one session's recordings."""
EFFECT = {"backlash": {"half_width_deg": 0.3}}


def close_copies(sessions: int, rate_hz: float) -> None:
    """Close the loop on the recordings of some sessions of the same rig."""
    plant = (26.0, 524.0, 508.0)
    records = [record for seed in range(sessions) for record in session(EFFECT, seed=seed, fps=rate_hz, plant=plant)]
    close_records(records)


def seconds_and_memory(work: Callable[..., object], *arguments: object) -> tuple[float, float, float]:
    """Return wall time and CPU time, s, of the second of two runs, and the highest resident size, MB."""
    work(*arguments)
    began = time.process_time()
    wall, memory = cost(lambda _: work(*arguments), Path())
    return wall, time.process_time() - began, memory


def alone(work: Callable[..., object], *arguments: object) -> tuple[float, float, float]:
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(seconds_and_memory, work, *arguments).result()


def table(title: str, sizes: Sequence[float], rows: Sequence[tuple[float, float, float]]) -> None:
    """Print one table with its exponent."""
    print(f"\n| {title} | wall, s | CPU, s | memory, MB |\n| --- | --- | --- | --- |")
    for size, (wall, cpu, memory) in zip(sizes, rows, strict=True):
        print(f"| {size:,.0f} | {wall:.1f} | {cpu:.1f} | {memory:.0f} |")
    slope = np.polyfit(np.log(sizes), np.log([cpu for _, cpu, _ in rows]), 1)[0]
    last = np.log(rows[-1][1] / rows[-2][1]) / np.log(sizes[-1] / sizes[-2])
    print(f"| exponent {slope:.2f}, of the last two {last:.2f} | | | |", flush=True)


def main(longest: int) -> None:
    print(f"{date.today():%d %B %Y}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        short, _ = film(folder / "short", {"size": [640, 480], "codec": "mjpeg"}, 10.0)
        lengths = [length for length in LENGTHS if length <= longest]
        clips = [repeat(short, length, folder / f"{length}.avi") for length in lengths]
        table("frames of 640 × 480, MJPEG", lengths, [alone(measure, clip) for clip in clips])
        clips = [film(folder / f"{size[0]}", {"size": size, "codec": "mjpeg"}, 5.0)[0] for size in SIZES]
        pixels = [width * height for width, height in SIZES]
        table("pixels, 150 frames", pixels, [alone(measure, clip) for clip in clips])
    table("recordings", [5 * n for n in SESSIONS], [alone(close_copies, n, RATES_HZ[0]) for n in SESSIONS])
    table("frames/s of five recordings", RATES_HZ, [alone(close_copies, 1, rate) for rate in RATES_HZ])


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else LENGTHS[-1])
