"""Sessions drawn by a second, independent renderer: flat, textured, with a second red object in the picture.

    truth = draw_session(folder, look=Look(marker="ring"), recordings=standard_recordings(), seed=3)

writes clips, commands and rig.yaml into the folder, and returns their truth. It shares no code with `synth` or with the
code that measures.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import yaml

from .look import SIZE, Look
from .motion import Plant, Recording, command_rows, move
from .scene import Scene

__all__ = [
    "Look",
    "Plant",
    "Recording",
    "Truth",
    "draw_frames",
    "draw_session",
    "standard_recordings",
    "write_clip",
    "write_truth",
]

RATE_HZ = 30


@dataclass(frozen=True)
class Truth:
    """The truth of one clip, frame by frame."""

    clip: Path
    time_s: np.ndarray
    """On the clip's clock, which is exact and equals the true time."""
    angle_deg: np.ndarray
    """From neutral, up positive."""
    mark_px: np.ndarray
    """Centroid of the lips' area, shape (n, 2)."""
    pivot_px: np.ndarray
    """Centre of rotation, shape (2,)."""
    command: np.ndarray | None
    """Rows (time_s, command_deg) of the command file; None without a command."""


def standard_recordings() -> list[Recording]:
    """Return five recordings that excite all effects of a plant; the random steps are held out."""
    return [
        Recording("steps", "steps"),
        Recording("stairs", "stairs", amplitude_deg=15.0),
        Recording("triangle", "triangle", amplitude_deg=14.0),
        Recording("chirp", "chirp", amplitude_deg=8.0),
        Recording("random", "random", held_out=True),
    ]


def draw_session(
    directory: str | Path,
    *,
    look: Look | None = None,
    plant: Plant | None = None,
    recordings: list[Recording] | None = None,
    seed: int = 0,
    codec: str = "MJPG",
    mouth: str = "auto",
    hint_error_px: float | None = 8.0,
    rig: dict | None = None,
) -> dict[str, Truth]:
    """Film a session and return its truth.

    Parameters
    ----------
    directory : path
        Folder for clips, command files and rig.yaml; created if missing.
    look, plant : Look, Plant
        The picture and the mechanism.
    recordings : list of Recording
        `standard_recordings()` by default.
    seed : int
        Seed of the noise, the random commands and the error of the pivot hint.
    codec : str
        ``MJPG``, or ``FFV1`` for lossless clips.
    mouth : str
        ``auto``, or ``declared``: the rig file states the lips' colour.
    hint_error_px : float or None
        Largest error of the pivot hint; None for no hint.
    rig : dict
        Keys of rig.yaml to add or to replace.

    Returns
    -------
    dict
        A `Truth` for each recording, by name.
    """
    folder, look, plant = Path(directory), look or Look(), plant or Plant()
    recordings = standard_recordings() if recordings is None else recordings
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(seed)
    declared = _rig(look, recordings, mouth, hint_error_px, rng) | (rig or {})
    (folder / "rig.yaml").write_text(yaml.safe_dump(declared, sort_keys=False))
    truths = {}
    for recording in recordings:
        times = np.arange(round(recording.duration_s * RATE_HZ)) / RATE_HZ
        rows = None if recording.kind == "release" else command_rows(recording, rng)
        if rows is not None:
            lines = [f"{t:.6f},{u:.5f}\n" for t, u in rows]
            (folder / f"{recording.name}.command.csv").write_text("time_s,command_deg\n" + "".join(lines))
        angles = move(plant, recording, times, rows)
        clip = folder / f"{recording.name}.avi"
        write_clip(clip, draw_frames(look, angles, times, int(rng.integers(2**31))), codec)
        truths[recording.name] = Truth(clip, times, angles, look.mouth(angles), look.pivot, rows)
    return truths


def _rig(
    look: Look, recordings: list[Recording], mouth: str, hint_error_px: float | None, rng: np.random.Generator
) -> dict:
    pivot: dict = {"marker": look.marker.split("_")[0]}
    if hint_error_px is not None:
        away, towards = hint_error_px * np.sqrt(rng.uniform()), rng.uniform(0, 2 * np.pi)
        hint = look.pivot + away * np.array([np.cos(towards), np.sin(towards)])
        pivot = {"near": [round(float(v), 1) for v in hint], **pivot}
    return {
        "mouth": "auto" if mouth == "auto" else {"rgb": list(look.lips_rgb)},
        "pivot": pivot,
        "facing": look.facing,
        "held_out": [r.name for r in recordings if r.held_out],
    }


def draw_frames(
    look: Look, angles_deg: np.ndarray, times_s: np.ndarray | None = None, seed: int = 0
) -> Iterator[np.ndarray]:
    """Yield the sensor's frames: 8-bit BGR with noise."""
    scene = Scene(look)
    times = np.arange(len(angles_deg)) / RATE_HZ if times_s is None else times_s
    noise = np.empty((SIZE[1], SIZE[0], 3), np.float32)
    cv2.setRNGSeed(seed)  # cv2's generator is twice as fast as numpy's, and noise is half of a frame's time
    for angle, time in zip(angles_deg, times, strict=True):
        image = scene.at(float(angle), float(time))
        cv2.randn(noise, (0, 0, 0), (look.noise,) * 3)
        image += noise
        yield cv2.convertScaleAbs(np.maximum(image, 0, out=image))


def write_clip(path: Path, frames: Iterator[np.ndarray], codec: str = "MJPG") -> None:
    """Encode frames while the next frame is being drawn."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*codec), RATE_HZ, SIZE)
    if not writer.isOpened():
        raise OSError(f"{path}: cannot be written as {codec}")
    with ThreadPoolExecutor(1) as encoder:
        busy = None
        for frame in frames:
            if busy is not None:
                busy.result()
            busy = encoder.submit(writer.write, frame)
    writer.release()


def write_truth(path: Path, truth: Truth) -> None:
    """Save the truth as a table with one row per frame."""
    n = len(truth.time_s)
    table = np.column_stack(
        [
            np.arange(n),
            truth.time_s,
            truth.time_s,
            truth.angle_deg,
            truth.mark_px,
            np.broadcast_to(truth.pivot_px, (n, 2)),
        ]
    )
    columns = "frame,time_s,true_time_s,angle_deg,mouth_x_px,mouth_y_px,pivot_x_px,pivot_y_px"
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savetxt(path, table, ["%d", "%.6f", "%.6f"] + ["%.6f"] * 5, ",", header=columns, comments="")
