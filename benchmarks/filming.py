"""Measures how fast whole films are made, including sensor and codec, and how the time is divided.

    .venv/bin/python benchmarks/filming.py

Films stairs by the demo's rig at 640 × 480 and 1280 × 720, without and with motion blur, and a chirp to 5 Hz at
640 × 480 with motion blur, with one worker per core. Also prints the time of one drawing, of the sensor and of the
codec on one core.
"""

from __future__ import annotations

import tempfile
import time
from datetime import date
from pathlib import Path

import numpy as np

from synth.clip import clip_writer
from synth.film import Stage
from synth.render import Studio, workers
from synth.sensor import develop
from synth.spec import Spec, read_spec
from synth.take import perform, plan, view

DEMO = Path(__file__).parents[1] / "configs" / "demo.yaml"
WARM_UP = 48
"""Frames that are not timed, while the workers start and load."""
STAIRS, CHIRP = 0, 1
RECORDINGS = (
    {"name": "stairs", "duration_s": 6.0, "command": {"kind": "stairs", "levels_deg": [15, 0, -12, 6, 18, 0]}},
    {
        "name": "chirp",
        "duration_s": 7.0,
        "command": {"kind": "chirp", "amplitude_deg": 9, "from_hz": 0.3, "to_hz": 5.0},
    },
)
FILMS = (
    ((640, 480), 0.0, STAIRS),
    ((640, 480), 0.01, STAIRS),
    ((640, 480), 0.01, CHIRP),
    ((1280, 720), 0.0, STAIRS),
    ((1280, 720), 0.01, STAIRS),
)
"""Size in px, exposure in s, recording."""


def variant(size: tuple[int, int], exposure_s: float) -> Spec:
    demo = read_spec(DEMO).model_dump()
    demo["camera"] |= {"size": size, "exposure_s": exposure_s}
    demo["recordings"] = [dict(recording) for recording in RECORDINGS]
    demo["declare"]["held_out"] = []
    demo["rig"] |= {"lever_px": size[1] / 2.4, "pivot_px": (size[0] * 0.375, size[1] * 0.625)}
    return Spec.model_validate(demo)


def measure(spec: Spec, recording: int) -> list[str]:
    seen = view(spec)
    take = perform(spec, seen)[recording]
    frames = list(range(len(take.table.stamps)))
    with tempfile.TemporaryDirectory() as folder, Studio(spec, seen, workers()) as studio:
        with clip_writer(Path(folder) / "film.avi", spec.camera, take.table) as write:
            for done, picture in enumerate(studio.film(take, frames)):
                if done == WARM_UP:
                    start = time.perf_counter()
                write(picture)
            whole = (time.perf_counter() - start) / (len(frames) - WARM_UP)
        start = time.perf_counter()
        with clip_writer(Path(folder) / "again.avi", spec.camera, take.table) as write:
            for _ in frames:
                write(picture)
        coding = (time.perf_counter() - start) / len(frames)
    plans = [plan(spec, seen, take, frame) for frame in frames]
    stage = Stage(spec, seen)
    drawn = plans[:: len(plans) // 24]
    stage.light(drawn[0])
    start = time.perf_counter()
    lights = [stage.light(exposure) for exposure in drawn]
    drawing = (time.perf_counter() - start) / sum(len(exposure.times) for exposure in drawn)
    start = time.perf_counter()
    for light, exposure in zip(lights, drawn, strict=True):
        develop(light, spec.camera, exposure.gain, np.random.default_rng(0))
    sensing = (time.perf_counter() - start) / len(drawn)
    instants = np.mean([len(exposure.times) for exposure in plans])
    return [f"{1 / whole:.0f}", f"{instants:.1f}", *(f"{1000 * part:.1f}" for part in (drawing, sensing, coding))]


def main() -> None:
    print(f"{date.today():%d %B %Y}, {workers()} workers, MJPEG\n")
    print("| film | fps | instants a frame | one instant, ms | sensor, ms | codec, ms |")
    print("| --- | --- | --- | --- | --- | --- |")
    for size, exposure_s, recording in FILMS:
        name = f"{size[0]} × {size[1]}, exposure {1000 * exposure_s:.0f} ms{', chirp' if recording == CHIRP else ''}"
        print(f"| {name} | {' | '.join(measure(variant(size, exposure_s), recording))} |", flush=True)


if __name__ == "__main__":
    main()
