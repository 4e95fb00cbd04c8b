"""Compares methods of measuring the angle in accuracy and speed, on the same films with known truth.

    python3 -m venv build/peers
    build/peers/bin/pip install -e .
    build/peers/bin/pip install -r benchmarks/peers-requirements.txt
    apt-get install --no-install-recommends octave octave-image
    build/peers/bin/python benchmarks/peers.py [seconds]

anglecam gets no information but the clip. Every other method gets what a careful user could know: the mouth's true
colour, the true centre of rotation, and the region in which the mouth moves, or its true place in the first frame. The
median is subtracted from every method's error, so that a method's definition of the mouth's place does not count, only
its consistency. All Python methods read through anglecam's decoder and their rates include it; Octave's rate includes
reading PNG files of the same frames. A method that is not installed is left out with a message.
"""

from __future__ import annotations

import csv
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import date
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

import cv2
import numpy as np
from throughput import film

import anglecam
from anglecam.io.rig import Rig
from anglecam.video.open_film import open_film
from synth.spec.picture import Rig as TrueRig

CAMERAS = {"FFV1": {"codec": "ffv1"}, "MJPEG": {"codec": "mjpeg"}, "H.264 crf 18": {"codec": "h264", "crf": 18}}
ROOM_PX = 35
"""Margin around all positions of the mouth's centre: contains the whole mouth and some cheek."""
MOUTH_PX = 45
"""Width of the mouth."""
BLOBS_PX = {"mouth": 55, "shaft": 35}
"""Diameters for trackpy, odd. Of 35, 45 and 55, with noise sizes 1 and 3, these lose no frame on FFV1."""
BLOB_ROOM_PX = 60
"""Margin for trackpy, which ignores blobs nearer to the border than their radius."""
SCRIPT = Path(__file__).with_name("octave_method.m")
Found = tuple[dict[str, np.ndarray], float]
"""For each definition of the point the angle (frames,), rad, NaN where nothing was found; and the total time, s."""


@dataclass(frozen=True)
class Film:
    """A clip, and the truth that the methods use."""

    clip: Path
    angle: np.ndarray
    """(frames,) rad."""
    mouth: np.ndarray
    """(frames, 2) px."""
    pivot: np.ndarray
    """(2,) px."""

    def box(self, room_px: int = ROOM_PX) -> tuple[int, int, int, int]:
        """Return left, top, right, bottom of the region in which the mouth moves, px; the last two are exclusive."""
        low, high = self.mouth.min(0) - room_px, self.mouth.max(0) + room_px
        return tuple(np.concatenate([low, high]).astype(int).tolist())

    def pictures(self) -> Iterator[np.ndarray]:
        """Yield every frame, blue, green, red."""
        return (frame.image for frame in open_film(self.clip).frames())

    def redness(self, room_px: int = ROOM_PX) -> Iterator[np.ndarray]:
        """Yield the box of every frame as red over the mean of green and blue."""
        left, top, right, bottom = self.box(room_px)
        for picture in self.pictures():
            blue, green, red = np.moveaxis(picture[top:bottom, left:right].astype(float), 2, 0)
            yield red - (green + blue) / 2

    def direction(self, points: Sequence[np.ndarray]) -> np.ndarray:
        """Return the directions of (x, y) points from the true pivot, rad."""
        arms = np.array(points) - self.pivot
        return np.arctan2(-arms[:, 1], arms[:, 0])


def shoot(folder: Path, camera: dict, seconds: float) -> Film:
    clip, truth = film(folder, {"size": [640, 480], **camera}, seconds, quality="metrology")
    with truth.open() as stream:
        rows = list(csv.DictReader(stream))
    column = {name: np.array([float(row[name]) for row in rows]) for name in rows[0] if name[-3:] in ("deg", "_px")}
    mouth = np.column_stack([column["mouth_x_px"], column["mouth_y_px"]])
    pivot = np.array([column["pivot_x_px"][0], column["pivot_y_px"][0]])
    return Film(clip, np.radians(column["angle_deg"]), mouth, pivot)


def threshold() -> float:
    """Return the redness halfway between the true colours of lips and skin."""
    return float(np.mean([rgb[0] - (rgb[1] + rgb[2]) / 2 for rgb in (TrueRig().lips_rgb, TrueRig().skin_rgb)]))


def with_anglecam(film: Film) -> Found:
    began = time.perf_counter()
    series = anglecam.measure(film.clip, Rig())
    seconds = time.perf_counter() - began
    arms = series.mark_px - series.pivot_px
    centroid = np.arctan2(-arms[:, 1], arms[:, 0])
    return {"anglecam": series.angle, "anglecam, the mouth's centroid alone": centroid}, seconds


def with_scikit_image(film: Film) -> Found:
    from scipy.ndimage import binary_fill_holes
    from skimage.feature import canny
    from skimage.measure import label, regionprops

    began = time.perf_counter()
    tips, centroids, half, corner = [], [], threshold(), np.array(film.box()[:2])
    for redness in film.redness():
        filled = binary_fill_holes(canny((redness > half).astype(float)))
        mouth = max(regionprops(label(filled)), key=lambda region: region.area, default=None)
        if mouth is None:
            tips.append(np.full(2, np.nan))
            centroids.append(np.full(2, np.nan))
            continue
        pixels = mouth.coords[:, ::-1] + corner
        tips.append(pixels[np.argmax(np.hypot(*(pixels - film.pivot).T))])
        centroids.append(np.array(mouth.centroid[::-1]) + corner)
    rows = {"the paper's way, scikit-image, tip": tips, "the paper's way, scikit-image, centroid": centroids}
    return {name: film.direction(points) for name, points in rows.items()}, time.perf_counter() - began


def with_octave(film: Film) -> Found:
    with tempfile.TemporaryDirectory() as folder:
        for number, picture in enumerate(film.pictures()):
            cv2.imwrite(f"{folder}/{number:06d}.png", picture)
        numbers = [f"{number:.6f}" for number in (*film.box(), threshold(), *film.pivot)]
        call = ["octave-cli", "--norc", str(SCRIPT), folder, *numbers, f"{folder}/found.csv"]
        printed = subprocess.run(call, check=True, capture_output=True, text=True).stdout
        tips, centroids = np.hsplit(np.genfromtxt(f"{folder}/found.csv", delimiter=","), 2)
    rows = {"the paper's way, Octave, tip": tips, "the paper's way, Octave, centroid": centroids}
    return {name: film.direction(points) for name, points in rows.items()}, float(printed.split()[-1])


def with_trackpy(film: Film) -> Found:
    """Locate mouth and shaft separately in every frame; with one blob in each box there is nothing to link."""
    import trackpy

    began = time.perf_counter()
    corner = np.array(film.box(BLOB_ROOM_PX)[:2])
    left, top = around = film.pivot.round().astype(int) - BLOB_ROOM_PX
    shaft = np.s_[top : top + 2 * BLOB_ROOM_PX + 1, left : left + 2 * BLOB_ROOM_PX + 1]
    angles = []
    for redness, picture in zip(film.redness(BLOB_ROOM_PX), film.pictures(), strict=True):
        grey = picture[shaft].mean(axis=2)
        mouths = (
            trackpy.locate(redness.clip(0), BLOBS_PX["mouth"], noise_size=3, topn=1)[["x", "y"]].to_numpy() + corner
        )
        shafts = trackpy.locate(grey, BLOBS_PX["shaft"], topn=1, invert=True)[["x", "y"]].to_numpy() + around
        across, down = (mouths[0] - shafts[0]) if len(mouths) and len(shafts) else (np.nan, np.nan)
        angles.append(np.arctan2(-down, across))
    return {"trackpy, mouth and shaft": np.array(angles)}, time.perf_counter() - began


def with_csrt(film: Film) -> Found:
    began = time.perf_counter()
    pictures = film.pictures()
    corner = (film.mouth[0] - MOUTH_PX / 2).round().astype(int)
    tracker = cv2.TrackerCSRT_create()
    tracker.init(next(pictures), (*corner.tolist(), MOUTH_PX, MOUTH_PX))
    centres = [corner + MOUTH_PX / 2]
    for picture in pictures:
        seen, (left, top, width, height) = tracker.update(picture)
        centres.append(np.array([left + width / 2, top + height / 2]) if seen else np.full(2, np.nan))
    return {"OpenCV's CSRT tracker": film.direction(centres)}, time.perf_counter() - began


def octave_says(command: str) -> str | None:
    """Return Octave's output; ``None`` if it is not installed or fails."""
    if shutil.which("octave-cli") is None:
        return None
    done = subprocess.run(["octave-cli", "--norc", "--eval", command], check=False, capture_output=True, text=True)
    return done.stdout.strip() if done.returncode == 0 else None


def methods() -> Iterator[tuple[str, Callable[[Film], Found]]]:
    """Yield the installed methods, named with their versions; print which are missing."""
    octave = octave_says('pkg load image; printf("%s, image %s", version, pkg("list", "image"){1}.version)')
    needs = [
        (with_anglecam, f"anglecam {anglecam.__version__}", ""),
        (
            with_scikit_image,
            find_spec("skimage") and f"scikit-image {version('scikit-image')}",
            "pip install scikit-image",
        ),
        (with_octave, octave and f"Octave {octave}", "apt-get install octave octave-image"),
        (with_trackpy, find_spec("trackpy") and f"trackpy {version('trackpy')}", "pip install trackpy"),
        (
            with_csrt,
            hasattr(cv2, "TrackerCSRT_create") and f"OpenCV {cv2.__version__}",
            "opencv-contrib-python-headless in place of opencv-python-headless",
        ),
    ]
    for method, there, remedy in needs:
        if there:
            yield there, method
        else:
            print(f"{method.__name__}: left out, it needs {remedy}\n")


def rms_deg(found: np.ndarray, true: np.ndarray) -> float:
    """Return the RMS of the error minus its median, over the frames with a result."""
    error = np.degrees(found - true)
    return float(np.sqrt(np.nanmean((error - np.nanmedian(error)) ** 2)))


def main(seconds: float) -> None:
    there = list(methods())
    print(f"{date.today():%d %B %Y}; {'; '.join(name for name, _ in there)}\n")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        films = [shoot(folder / f"{codec}", camera, seconds) for codec, camera in CAMERAS.items()]
        warm = shoot(folder / "warm", CAMERAS["MJPEG"], 4.0)
        print("| |", " ".join(f"{codec}, ° RMS | frames/s |" for codec in CAMERAS), "frames lost |")
        print("| --- " * (2 * len(films) + 2) + "|")
        for _, method in there:
            method(warm)  # compiles and loads on first use
            found = [method(film) for film in films]
            for way in found[0][0]:
                cells, lost = [], 0
                for (angles, took), film in zip(found, films, strict=True):
                    cells += [f"{rms_deg(angles[way], film.angle):.2g}", f"{len(film.angle) / took:.0f}"]
                    lost += np.isnan(angles[way]).sum()
                print(f"| {way} | {' | '.join(cells)} | {lost} |", flush=True)


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 10.0)
