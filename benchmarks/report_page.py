"""Size of the page of a clip of 10,000 frames, and the time until it answers in a browser.

    .venv/bin/python -m benchmarks.report_page [--frames N] [--out DIR]

The pictures of the page are noise on top of a still scene, which compresses badly. The time is from the start of the
navigation to the moment at which the curves are drawn and answer to the pointer, the median of five loads.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from statistics import median
from types import SimpleNamespace

import numpy as np
from playwright.sync_api import sync_playwright

from anglecam.data.series import AngleSeries
from anglecam.report.clip_page import write_clip_html
from anglecam.report.origin import origin_of
from anglecam.report.page_names import page_name

LOADS = 5
ARGUMENTS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update"]


def clip(n: int) -> tuple[SimpleNamespace, SimpleNamespace]:
    """Return a measured clip of n frames and its film, 640 × 480."""
    rng = np.random.default_rng(1)
    t = np.arange(n) / 30.0
    angle = 0.3 * np.sin(2.0 * t) * np.exp(-t / t[-1]) + rng.normal(0.0, 1e-4, n)
    pivot = np.tile([200.0, 240.0], (n, 1))
    mark = pivot + 180.0 * np.column_stack([np.cos(angle), -np.sin(angle)])
    bounds = {r: np.full(n, np.arcsin(r / 180.0)) for r in (6.0, 10.0)}
    sigma = 1e-4 * rng.uniform(0.8, 1.2, n)
    series = AngleSeries("long", t, angle, sigma, ("ok",) * n, angle, mark, pivot, bounds)
    scene = np.kron(rng.integers(40, 200, (12, 16, 3)), np.ones((40, 40, 1)))

    def picture(k: int) -> np.ndarray:
        return np.clip(scene + rng.normal(0.0, 4.0, scene.shape), 0, 255).astype(np.uint8)

    film = SimpleNamespace(frames=lambda only: (SimpleNamespace(index=k, image=picture(k)) for k in sorted(only)))
    return SimpleNamespace(series=series, by="whole body", pivot="marker", doubt=None, notes=()), film


def ready_ms(page_file: Path) -> list[float]:
    """Return the times at which the page was ready, ms, of several loads."""
    with sync_playwright() as started:
        browser = started.chromium.launch(executable_path="/usr/bin/chromium", args=ARGUMENTS)
        found = []
        for _ in range(LOADS):
            page = browser.new_page(viewport={"width": 1280, "height": 900})
            page.goto(page_file.resolve().as_uri())
            page.wait_for_selector("html[data-ready]")
            found.append(float(page.locator("html").get_attribute("data-ready") or "nan"))
            page.close()
        browser.close()
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=10_000)
    parser.add_argument("--out", type=Path, default=Path("build/report_page"))
    asked = parser.parse_args()
    measurement, film = clip(asked.frames)
    began = time.process_time()
    write_clip_html(asked.out, measurement, film, None, (), origin_of(()))
    took = time.process_time() - began
    path = asked.out / page_name("long")
    times = ready_ms(path)
    print(f"{asked.frames} frames: {path.stat().st_size / 1e6:.1f} MB, written in {took:.1f} s of processor time")
    print(f"interactive after {median(times) / 1000.0:.2f} s ({min(times) / 1000.0:.2f} … {max(times) / 1000.0:.2f} s)")


if __name__ == "__main__":
    main()
