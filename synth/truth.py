"""Writes the true motion and every parameter to the truth folder."""

from __future__ import annotations

import csv
import hashlib
import json
import platform
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from synth.camera import Pinhole
from synth.motion import linear_model
from synth.spec import Spec
from synth.take import Take, View, marks

DEPENDENCIES = ("anglecam", "numpy", "scipy", "numba", "opencv-python-headless", "trimesh", "pyrender", "av")
"""Packages that can affect a film; ``truth.json`` records their versions."""
COLUMNS = (
    "frame", "time_s", "true_time_s", "angle_deg", "mouth_x_px", "mouth_y_px", "pivot_x_px", "pivot_y_px",
    "mark_x_px", "mark_y_px", "status", "frame_sha256",
)  # fmt: skip
"""The pivot is the centre of rotation; the mark is painted on the shaft, or beside it with `pivot_offset`."""


def fingerprint(frame: NDArray[np.uint8]) -> str:
    """Return the hash of a frame's pixels before encoding, row by row in the order red, green, blue."""
    return hashlib.sha256(frame.tobytes()).hexdigest()


def write_take(folder: Path, seen: View, take: Take, fingerprints: list[str]) -> None:
    """Write ``NAME.truth.csv``.

    Parameters
    ----------
    folder : Path
        Existing folder, separate from the session.
    seen : View
        The camera.
    take : Take
        The recording.
    fingerprints : list of str
        `fingerprint` of every frame of the file.
    """
    table = take.table
    angles = np.degrees(take.motion.angle(table.taken))
    with (folder / f"{take.recording.name}.truth.csv").open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(COLUMNS)
        for frame, (time, taken, angle, pixels, repeats, digest) in enumerate(
            zip(table.times, table.taken, angles, marks(seen, take), table.repeats, fingerprints, strict=True)
        ):
            writer.writerow(
                [frame, f"{time:.9f}", f"{taken:.9f}", f"{angle:.9f}", *(f"{pixel:.6f}" for pixel in pixels),
                 "duplicate" if repeats else "own", digest]
            )  # fmt: skip


def write_facts(folder: Path, spec: Spec, seen: View, edges: dict[str, Any]) -> None:
    """Write ``truth.json``: every parameter and effect, the camera, seed and versions.

    Parameters
    ----------
    folder : Path
        Existing folder, separate from the session.
    spec : Spec
        The whole session.
    seen : View
        The camera.
    edges : dict
        The renderer's edge errors.
    """
    facts = {
        "seed": spec.seed,
        "plant": spec.plant.model_dump(),
        "linear_model": dict(zip("abc", linear_model(spec.plant, spec.rig.linkage), strict=True)),
        "controller": spec.controller.model_dump(),
        "effects": spec.effects.model_dump(exclude_none=True),
        "camera": {**spec.camera.model_dump(), **_optics(seen.pinhole)},
        "rig": spec.rig.model_dump(),
        "scene": spec.scene.model_dump(),
        "render": {**spec.render.model_dump(), "edge_error": edges},
        "mouth_m": seen.mouth.tolist(),
        "recordings": {
            recording.name: {"duration_s": recording.duration_s, "command": recording.command.model_dump()}
            for recording in spec.recordings
        },
        "declare": spec.declare,
        "versions": {
            "python": platform.python_version(),
            **{name: version(name) for name in DEPENDENCIES},
        },
    }
    (folder / "truth.json").write_text(json.dumps(facts, indent=1, default=str) + "\n", encoding="utf-8")


def _optics(pinhole: Pinhole) -> dict[str, Any]:
    return {**asdict(pinhole), "rotation": pinhole.rotation.tolist(), "lens_px": pinhole.lens_px}
