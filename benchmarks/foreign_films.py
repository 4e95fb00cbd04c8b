"""Measures the angle's error and its stated uncertainty on films of an independent renderer, beside OpenCV's methods.

    build/mitsuba/bin/python benchmarks/foreign/render.py FOLDER      # once: see there
    .venv/bin/python -m benchmarks.foreign_films FOLDER [name ...]

anglecam gets the clip alone, without a rig file. ECC and Lucas-Kanade get a rectangle that the body fills in the first
frame. Each method's mean error is removed: its zero is a matter of definition. What remains includes an error of scale,
which is also given by itself.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from datetime import date
from importlib.metadata import version
from pathlib import Path

import cv2
import numpy as np

import anglecam
from anglecam.data.series import AngleSeries
from anglecam.errors import InputError
from anglecam.video.open_film import open_film
from benchmarks.foreign.peers import with_ecc, with_lucas_kanade

PEERS: dict[str, Callable[[Iterator[np.ndarray], tuple[int, int, int, int]], np.ndarray]] = {
    "ECC": with_ecc,
    "Lucas-Kanade": with_lucas_kanade,
}


def pictures(clip: Path) -> Iterator[np.ndarray]:
    """Yield every frame, blue, green, red."""
    return (frame.image for frame in open_film(clip).frames())


def errors_deg(angle_deg: np.ndarray, truth_deg: np.ndarray) -> np.ndarray:
    """Return the differences from the truth without their mean, whole turns apart; NaN where nothing was measured."""
    turns = np.degrees(np.unwrap(np.radians(angle_deg[np.isfinite(angle_deg)])))
    error = np.full(len(angle_deg), np.nan)
    error[np.isfinite(angle_deg)] = turns - truth_deg[np.isfinite(angle_deg)]
    return np.asarray(error - np.nanmean(error))


def described(error: np.ndarray, truth_deg: np.ndarray) -> str:
    """Return the cells RMS, scale error and worst error."""
    seen = np.isfinite(error)
    if seen.sum() < 3:
        return "– | – | –"
    scale = np.polyfit(truth_deg[seen], error[seen], 1)[0]
    return f"{np.sqrt((error[seen] ** 2).mean()):.4f} | {100 * scale:+.3f} | {np.abs(error[seen]).max():.4f}"


def truth_deg_of(clip: Path) -> np.ndarray:
    """Return the true angle of every frame."""
    return np.genfromtxt(f"{_stem(clip)}.truth.csv", delimiter=",", names=True)["angle_deg"]


def series_errors_deg(series: AngleSeries, truth_deg: np.ndarray) -> np.ndarray:
    """Return `errors_deg` of what anglecam measured."""
    return errors_deg(np.where(series.ok, np.degrees(series.angle), np.nan), truth_deg)


def rows(clip: Path) -> Iterator[str]:
    """Yield the table's rows for one clip."""
    truth = truth_deg_of(clip)
    try:
        series = anglecam.measure(clip)
    except InputError as refusal:
        yield f"| {clip.name} | anglecam | refused: {str(refusal).split(': ', 1)[-1]} | | | | |"
    else:
        error = series_errors_deg(series, truth)
        pull = error / np.degrees(series.sigma)
        cells = described(error, truth)
        lost = int((~series.ok).sum())
        yield f"| {clip.name} | anglecam | {cells} | {np.sqrt(np.nanmean(pull**2)):.2f} | {lost} of {len(truth)} |"
    region = tuple(int(v) for v in Path(f"{_stem(clip)}.region.txt").read_text().split())
    for name, method in PEERS.items():
        error = errors_deg(np.degrees(method(pictures(clip), region)), truth)
        yield f"| {clip.name} | {name} | {described(error, truth)} | | {int(np.isnan(error).sum())} of {len(truth)} |"


def _stem(clip: Path) -> Path:
    return clip.with_name(clip.name.split(".")[0])


def main() -> None:
    """Print the table."""
    folder, names = Path(sys.argv[1]), sys.argv[2:]
    print(f"{date.today():%-d %B %Y}, anglecam {version('anglecam')}, OpenCV {cv2.__version__}\n")
    print("| film | method | RMS, ° | scale error, % | worst, ° | RMS(error ÷ sigma) | frames lost |")
    print("| --- " * 7 + "|")
    for clip in sorted(p for p in folder.iterdir() if p.suffix in (".avi", ".mp4")):
        if not names or clip.name.split(".")[0] in names:
            for row in rows(clip):
                print(row, flush=True)


if __name__ == "__main__":
    main()
