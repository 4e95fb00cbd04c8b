"""Measures the time of `measure` relative to decoding the clip, and its memory for long clips.

    .venv/bin/python benchmarks/throughput.py [rounds]

Time: `measure_clip` without overlay or plot, relative to decoding the same file by PyAV with the threads that
`anglecam.video.frames` uses and without colour conversion. The two alternate, so that the machine's load affects both;
figures are medians over the rounds. `measure`'s progress reports divide its time into readings (from the first frame of
a reading to its last) and learning (what is before and between them).

Memory: the highest resident size of a fresh process that measures one clip. The long clips repeat the packets of a
short one: MJPEG's packets are independent, and a motion played forwards and backwards is continuous.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from datetime import date
from itertools import cycle, islice, pairwise
from multiprocessing import get_context
from pathlib import Path
from statistics import median
from typing import Any

import av
import yaml

from anglecam.io.rig import Rig
from anglecam.measurement.clip import measure_clip
from anglecam.video.open_film import open_film
from synth.render import workers
from synth.session import render

FILMS: dict[str, dict[str, Any]] = {
    "640 × 480, MJPEG, 300 frames": {"size": [640, 480], "codec": "mjpeg"},
    "1920 × 1080, H.264, 600 frames": {"size": [1920, 1080], "codec": "h264"},
}
SECONDS = {"mjpeg": 10.0, "h264": 20.0}
LENGTHS = (100, 1_000, 3_000, 10_000)
"""Lengths of the clips, frames."""


def film(folder: Path, camera: dict[str, Any], seconds: float, quality: str = "standard") -> tuple[Path, Path]:
    """Film random steps of the default rig, scaled to the picture's height; return clip and truth."""
    width, height = camera["size"]
    spec = {
        "camera": camera,
        "rig": {"lever_px": height / 2.4, "pivot_px": [width * 0.375, height * 0.625]},
        "render": {"quality": quality},
        "recordings": [{"name": "swing", "duration_s": seconds, "command": {"kind": "random", "amplitude_deg": 15}}],
    }
    folder.mkdir()
    (folder / "spec.yaml").write_text(yaml.safe_dump(spec))
    render(folder / "spec.yaml", folder / "session", folder / "truth")
    suffix = "mp4" if camera["codec"] == "h264" else "avi"
    return folder / "session" / f"swing.{suffix}", folder / "truth" / "swing.truth.csv"


def repeat(clip: Path, frames: int, path: Path) -> Path:
    """Write this number of frames of an MJPEG clip, alternately forwards and backwards, without re-encoding."""
    with av.open(str(clip)) as source, av.open(str(path), "w") as target:
        forwards = [bytes(packet) for packet in source.demux(video=0) if packet.size]
        stream = target.add_stream_from_template(source.streams.video[0])
        for k, data in enumerate(islice(cycle(forwards + forwards[-2:0:-1]), frames)):
            packet = av.Packet(data)
            packet.stream, packet.time_base = stream, 1 / source.streams.video[0].average_rate
            packet.pts = packet.dts = k
            packet.is_keyframe = True
            target.mux(packet)
    return path


def decode(clip: Path) -> None:
    with av.open(str(clip)) as container:
        container.streams.video[0].codec_context.thread_type = "SLICE"
        for _ in container.decode(video=0):
            pass


def read(clip: Path) -> None:
    for _ in open_film(clip).frames():
        pass


def measure(clip: Path) -> list[float]:
    """Measure a clip; return the seconds of learning and of reading all frames."""
    ends = [time.perf_counter()]

    def progress(done: int, of: int) -> None:
        if done in (1, of):
            ends.append(time.perf_counter())

    measure_clip(open_film(clip), Rig(), progress=progress)
    parts = [after - before for before, after in pairwise(ends)]
    return [sum(parts[::2]), sum(parts[1::2])]


def seconds(work: Callable[[Path], object], clip: Path) -> tuple[float, object]:
    began = time.perf_counter()
    result = work(clip)
    return time.perf_counter() - began, result


def times(clip: Path, rounds: int) -> list[str]:
    """Return one row of the table: frames/s of decoding, and everything else in units of decoding."""
    measure(clip)  # compiles and loads on first use
    decoded, reads, measured, stages = [], [], [], []
    for _ in range(rounds):
        base, _ = seconds(decode, clip)
        decoded.append(base)
        reads.append(seconds(read, clip)[0] / base)
        whole, parts = seconds(measure, clip)
        measured.append(whole / base)
        stages.append([part / base for part in parts])
    parts = [f"{median(of):.2f}" for of in zip(*stages, strict=True)]
    frames = sum(1 for _ in open_film(clip).frames())
    rates = [frames / median(decoded), frames / median(d * m for d, m in zip(decoded, measured, strict=True))]
    ratios = [f"{median(reads):.2f}", *parts, f"**{median(measured):.2f}**"]
    return [*(f"{rate:.0f}" for rate in rates), *ratios]


def cost(work: Callable[[Path], object], clip: Path) -> tuple[float, float]:
    """Process a clip; return the time, s, and the highest resident size of this process so far, MB.

    `resource.getrusage` would also count the parent process.
    """
    took, _ = seconds(work, clip)
    status = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
    return took, int(status["VmHWM"].split()[0]) * 1024 / 1e6


def alone(work: Callable[[Path], object], clip: Path) -> tuple[float, float]:
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(cost, work, clip).result()


def main(rounds: int) -> None:
    print(f"{date.today():%d %B %Y}, {workers()} cores, {rounds} rounds\n")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        clips = {
            title: film(folder / camera["codec"], camera, SECONDS[camera["codec"]])[0]
            for title, camera in FILMS.items()
        }
        print("| film | decode, fps | measure, fps | read ÷ decode | learning | readings | measure ÷ decode |")
        print("| --- | --- | --- | --- | --- | --- | --- |")
        for title, clip in clips.items():
            print(f"| {title} | {' | '.join(times(clip, rounds))} |", flush=True)
        clip = next(iter(clips.values()))
        print("\n| 640 × 480, MJPEG, frames | only decode, MB | measure, MB | measure ÷ decode |")
        print("| --- | --- | --- | --- |")
        for frames in LENGTHS:
            long = repeat(clip, frames, folder / "long.avi")
            (decoding, least), (measuring, most) = alone(decode, long), alone(measure, long)
            print(f"| {frames:,} | {least:.0f} | {most:.0f} | {measuring / decoding:.1f} |", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 5)
