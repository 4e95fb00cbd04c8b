"""Measures the angle's error and its stated uncertainty, film by film, against the films' truth.

    .venv/bin/python benchmarks/metrology.py [name ...]

Two recordings of each rig and camera: stairs up to 21° with the oscillation of every step, and a triangle of ±22°, both
640 × 480 at 30 Hz, lever arm 200 px, noise 2 grey levels, rendered at quality `metrology`. anglecam gets only the
declarations that the table names. The bound is the Cramér–Rao bound for the rotation of the mouth patch about a known
pivot: no method that reads the mouth alone can be better, but a method that reads the whole head can.
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import dataclass, field
from datetime import date
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from anglecam.camera.calibration import Calibration, write_calibration
from anglecam.io.command_csv import read_command
from anglecam.io.rig import read_rig
from anglecam.measurement.clip import measure_clip
from anglecam.video.open_film import open_film
from synth.motion import move
from synth.session import render
from synth.spec import read_spec

COMMANDS = {
    "stairs": {"kind": "stairs", "levels_deg": [15, 0, -15, 8, 21, -8, 0], "tread_s": 0.6},
    "triangle": {"kind": "triangle", "amplitude_deg": 22, "period_s": 2.0},
}
SECONDS = {"stairs": 5.0, "triangle": 4.0}
PATCH_PX = 30
"""Half the side of the square around the mouth's centre for which the bound is computed, px."""
WRONG_DEG = 0.1
"""Error beyond which a row with status ok counts as wrong."""


@dataclass(frozen=True)
class Case:
    """A film and its declarations."""

    camera: dict[str, Any] = field(default_factory=dict)
    rig: dict[str, Any] = field(default_factory=dict)
    scene: dict[str, Any] = field(default_factory=dict)
    effects: dict[str, Any] = field(default_factory=dict)
    declare: dict[str, Any] = field(default_factory=dict)


LEFT = {"facing": "left", "pivot_px": [400.0, 300.0]}
CASES = {
    "lossless": Case({"codec": "ffv1"}),
    "MJPEG 4:4:4": Case(),
    "MJPEG 4:2:0": Case({"chroma": 420}),
    "H.264 crf 18": Case({"codec": "h264", "crf": 18}),
    "H.264 crf 28": Case({"codec": "h264", "crf": 28}),
    "dark skin, facing left": Case(rig=LEFT | {"skin": "dark"}, declare={"facing": "left"}),
    "no marker": Case(rig={"marker": "none"}),
    "distractor": Case(scene={"distractor": {"at_px": [520, 150], "width_px": 70, "sway_px": 30}}),
    "flicker 10 %": Case({"flicker": {"share": 0.1}}),
    "vignetting 40 %": Case({"vignetting": 0.4}),
    "shake 2 px": Case({"shake": {"rms_px": 2.0}}),
    "exposure 60 %": Case({"exposure_s": 0.02}, declare={"camera": {"exposure_s": 0.02}}),
    "occluder 0.5 s": Case(scene={"occluders": [{"from_s": 2.0, "for_s": 0.5}]}),
    "k1 = −0.15, calibrated": Case(
        {"codec": "ffv1", "distance_m": 0.6},
        effects={"lens_distortion": {"k1": -0.15}},
        declare={"camera": {"calibration": "lens.yaml"}},
    ),
    "tilt 15°, declared, calibrated": Case(
        {"codec": "ffv1"},
        effects={"camera_tilt": {"tilt_deg": 15.0}},
        declare={"camera": {"tilt_deg": 15.0, "calibration": "lens.yaml"}},
    ),
    "tilt 15°, declared, no focal length": Case(
        {"codec": "ffv1"}, effects={"camera_tilt": {"tilt_deg": 15.0}}, declare={"camera": {"tilt_deg": 15.0}}
    ),
    "rolling shutter 30 µs a row, declared": Case(
        {"codec": "ffv1"},
        effects={"rolling_shutter": {"row_time_s": 3e-5}},
        declare={"camera": {"row_time_s": 3e-5}},
    ),
}


def film(case: Case, folder: Path) -> Path:
    """Render a case's session and its truth; return the spec."""
    recordings = [{"name": k, "duration_s": SECONDS[k], "command": command} for k, command in COMMANDS.items()]
    spec = {
        "seed": 7,
        "rig": {"lever_px": 200.0} | case.rig,
        "camera": {"noise_grey": 2.0} | case.camera,
        "scene": case.scene,
        "effects": case.effects,
        "declare": case.declare,
        "render": {"quality": "metrology"},
        "recordings": recordings,
    }
    path = folder / "spec.yaml"
    path.write_text(yaml.safe_dump(spec, sort_keys=False))
    render(path, folder / "session", folder / "truth")
    if "calibration" in case.declare.get("camera", {}):
        _write_calibration(folder)
    return path


def clip_of(spec_file: Path, name: str) -> Path:
    """Return the film of one recording."""
    session = spec_file.parent / "session"
    return next(p for p in session.glob(f"{name}.*") if p.suffix in (".avi", ".mp4", ".mkv"))


def judge(spec_file: Path, name: str) -> tuple[np.ndarray, np.ndarray, int, int]:
    """Measure one clip; return errors and sigmas (°) of its ok rows, and the counts of other rows and broken bounds."""
    spec = read_spec(spec_file)
    session, clip = spec_file.parent / "session", clip_of(spec_file, name)
    recording = next(r for r in spec.recordings if r.name == name)
    command = session / f"{name}.command.csv"
    rig = read_rig(session / "rig.yaml")
    series = measure_clip(open_film(clip), rig, read_command(command)).series
    rows = np.loadtxt(command, delimiter=",", skiprows=1)
    ok = series.ok
    truth = np.degrees(move(spec, recording, rows, float(series.time[-1]) + 0.1).angle(series.time[ok]))
    error = np.degrees(series.angle[ok]) - truth
    broken = int((np.abs(error) > np.degrees(series.bounds[6.0][ok])).sum())
    return error, np.degrees(series.sigma[ok]), int((~ok).sum()), broken


def bound_deg() -> float:
    """Return the Cramér–Rao bound of the mouth patch at noise 2 in each of three colours."""
    nod = {"kind": "triangle", "amplitude_deg": 0.6, "period_s": 2.0}
    with tempfile.TemporaryDirectory() as folder:
        spec = Path(folder) / "spec.yaml"
        camera = {"noise_grey": 0.0, "codec": "ffv1"}
        recordings = [{"name": "nod", "duration_s": 2.0, "command": nod}]
        spec.write_text(yaml.safe_dump({"rig": {"lever_px": 200.0}, "camera": camera, "recordings": recordings}))
        render(spec, Path(folder) / "session", Path(folder) / "truth")
        truth = np.genfromtxt(Path(folder) / "truth" / "nod.truth.csv", delimiter=",", names=True, dtype=None)
        frames = [frame.image for frame in open_film(Path(folder) / "session" / "nod.avi").frames()]
    angle = np.radians(truth["angle_deg"])
    bounds = []
    for k in np.flatnonzero(np.abs(np.diff(angle)) > np.radians(0.02)):
        x, y = round(float(truth["mouth_x_px"][k])), round(float(truth["mouth_y_px"][k]))
        part = np.s_[y - PATCH_PX : y + PATCH_PX, x - PATCH_PX : x + PATCH_PX]
        slope = (frames[k + 1][part].astype(float) - frames[k][part]) / (angle[k + 1] - angle[k])
        # the difference contains rounding to whole grey levels, which is not part of the picture
        noise = 2.0 * slope.size / 12.0 / (angle[k + 1] - angle[k]) ** 2
        bounds.append(2.0 / np.sqrt((slope**2).sum() - noise))
    return float(np.degrees(np.median(bounds)))


def _write_calibration(folder: Path) -> None:
    camera = yaml.safe_load((folder / "truth" / "truth.json").read_text())["camera"]
    (x, y), f = camera["lens_px"], camera["focal_px"]
    matrix = np.array([[f, 0.0, x], [0.0, f, y], [0.0, 0.0, 1.0]])
    distortion = np.array([camera.get("k1") or 0.0, 0.0, 0.0, 0.0, 0.0])
    write_calibration(Calibration(tuple(camera["size"]), matrix, distortion), folder / "session" / "lens.yaml")


def main() -> None:
    """Print the table."""
    bound = bound_deg()
    print(f"Angle ({date.today():%-d %B %Y}, version {version('anglecam')}); bound of the mouth patch {bound:.5f}°\n")
    print("| film | recording | rows not ok | RMS, ° | RMS ÷ bound | mean, ° | sd(error ÷ sigma) | within 1.96 sigma |"
          " beyond 6 px | wrong |")  # fmt: skip
    print("| --- " * 10 + "|")
    for name in sys.argv[1:] or CASES:
        with tempfile.TemporaryDirectory() as folder:
            spec = film(CASES[name], Path(folder))
            for recording in COMMANDS:
                error, sigma, lost, broken = judge(spec, recording)
                rms, pull = float(np.sqrt((error**2).mean())), error / sigma
                wrong = int((np.abs(error) > WRONG_DEG).sum())
                print(
                    f"| {name} | {recording} | {lost} | {rms:.5f} | {rms / bound:.1f} | {error.mean():.5f} |"
                    f" {pull.std():.2f} | {100 * (np.abs(pull) < 1.96).mean():.0f} % | {broken} | {wrong} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
