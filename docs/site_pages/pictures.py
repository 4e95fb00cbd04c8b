"""The pictures of the site, made by the programs that they show."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import av
import numpy as np
from typer.testing import CliRunner

from anglecam.cli.app import app
from anglecam.workflow.self_test import write_film

ROOT = Path(__file__).resolve().parents[2]
SPEC = "demo"
"""Spec of which a frame is shown; each takes ten seconds."""
SHOWN_FRAME = 20


def draw(folder: Path) -> None:
    """Write all pictures into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as name:
        work = Path(name)
        _stick(work, folder)
        for verb, picture in (("response", "step"), ("kinematics", "linkage")):
            _run("neck", verb, "--out", work)
            (work / f"{picture}.png").replace(folder / f"{picture}.png")
    synth = Path(sys.executable).with_name("synth")  # a process of its own: its workers import what it imports
    subprocess.run([synth, "gallery", ROOT / f"configs/{SPEC}.yaml", "--out", folder], check=True, capture_output=True)


def _stick(work: Path, folder: Path) -> None:
    time = np.arange(40) / 30.0
    write_film(work / "stick.mkv", np.radians(12.0) * np.exp(-time) * np.cos(2.0 * np.pi * 1.5 * time))
    _run("measure", work / "stick.mkv", "--out", work, "--overlay")
    (work / "stick.png").replace(folder / "stick.png")
    with av.open(str(work / "stick.overlay.mp4")) as film:
        frames = film.decode(video=0)
        picture = next(frame for number, frame in enumerate(frames) if number == SHOWN_FRAME)
        picture.to_image(width=3 * picture.width, height=3 * picture.height).save(folder / "stick-overlay.png")


def _run(*arguments: object) -> None:
    """Run a command of anglecam in this process, which has imported it already."""
    done = CliRunner().invoke(app, [str(one) for one in arguments], catch_exceptions=False)
    if done.exit_code:
        raise SystemExit(done.output)
