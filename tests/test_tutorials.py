"""The tutorials' commands and code run as they stand, in their order, and lead to what the pages say.

A page is executed block by block in a separate folder: ``sh`` by line, on one page in a shell and on the others in this
process; ``python`` in one namespace; a ``yaml`` block is written to the file that its first line names.
"""

from __future__ import annotations

import io
import json
import re
import shlex
import subprocess
import sys
from collections.abc import Callable
from contextlib import redirect_stdout
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import pandas as pd
import pytest

from anglecam.cli.app import main
from anglecam.workflow.self_test import HEIGHT, WIDTH, write_film
from support.tracked import nod, write_deeplabcut, write_sleap

ROOT = Path(__file__).parents[1]
PAGES = sorted((ROOT / "docs" / "tutorials").glob("*.md"))
BLOCK = re.compile(r"^```(sh|python|yaml)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def run_line(line: str) -> None:
    """Run a command in a shell."""
    done = subprocess.run(line, shell=True, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{line}\n{done.stdout}{done.stderr}"


def call_line(line: str) -> None:
    """Do what a shell does with ``.venv/bin/anglecam ARGUMENTS [> FILE]``, in this process, which has imported all."""
    called, _, file = line.partition(" > ")
    program, *arguments = shlex.split(called)
    assert program == ".venv/bin/anglecam"
    printed = io.StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(printed):
        patch.setattr(sys, "argv", ["anglecam", *arguments])
        with pytest.raises(SystemExit) as ended:
            main()
    assert not ended.value.code, f"{line}\n{printed.getvalue()}"
    if file:
        Path(file).write_text(printed.getvalue())


def run_page(
    name: str, folder: Path, monkeypatch: pytest.MonkeyPatch, run: Callable[[str], None] = call_line
) -> dict[str, Any]:
    """Execute a tutorial in a folder, its commands by ``run``; return the namespace of its Python blocks."""
    monkeypatch.chdir(folder)
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    (folder / ".venv").mkdir()
    (folder / ".venv" / "bin").symlink_to(Path(sys.executable).parent)
    space: dict[str, Any] = {}
    for kind, text in BLOCK.findall((ROOT / "docs" / "tutorials" / f"{name}.md").read_text()):
        if kind == "python":
            exec(compile(text, name, "exec"), space)
        elif kind == "yaml":
            Path(text.splitlines()[0].removeprefix("# ")).write_text(text)
        else:
            for line in text.splitlines():
                run(line)
    return space


def film_by_phone(path: Path, angles: np.ndarray) -> None:
    """Write a film in H.264, as phones do."""
    lossless = path.with_suffix(".mkv")
    write_film(lossless, angles)
    with av.open(str(lossless)) as source, av.open(str(path), mode="w") as container:
        stream = container.add_stream("libx264", rate=Fraction(30), options={"crf": "16"})
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        for frame in source.decode(video=0):
            container.mux(stream.encode(frame.reformat(format="yuv420p")))
        container.mux(stream.encode())
    lossless.unlink()


def test_every_page_has_a_test():
    tested = {name.removeprefix("test_").replace("_", "-") for name in globals() if name.startswith("test_")}
    assert {page.stem for page in PAGES} <= tested


def test_your_own_clip(tmp_path, monkeypatch):
    true = np.radians(12.0) * np.sin(2.0 * np.pi * np.arange(45) / 30.0)
    film_by_phone(tmp_path / "stick.mp4", true)
    space = run_page("your-own-clip", tmp_path, monkeypatch)
    error = space["series"].angle - true
    assert np.degrees(np.std(error)) < 0.05
    assert (tmp_path / "result" / "stick.overlay.mp4").exists()
    document = json.loads((tmp_path / "measured.json").read_text())
    assert document["clips"][0]["measured"] == 45


def test_tracks(tmp_path, monkeypatch):
    rng = np.random.default_rng(1)
    true = 10.0 * np.sin(np.arange(120) / 10.0)
    write_deeplabcut(tmp_path / "nodDLC_resnet50_nodJan1shuffle1_50000.csv", nod(true, rng))
    write_sleap(tmp_path / "swing.analysis.h5", nod(true, rng))
    space = run_page("tracks", tmp_path, monkeypatch, run_line)
    angle = space["table"]["angle_deg"]
    assert np.std(angle - true) < 0.2
    assert len(pd.read_csv(tmp_path / "result" / "swing.angles.csv")) == 120


def test_hidden_backlash(tmp_path, monkeypatch):
    loop = run_page("hidden-backlash", tmp_path, monkeypatch)["loop"]
    assert loop["verdict"] == "attributed"
    assert loop["effects"][0]["id"] == "backlash"
    found = loop["effects"][0]["parameters"]["half_width_deg"]
    assert abs(found["value"] - 0.4) < 4.0 * found["sigma"] < 0.1
    assert loop["rmse_deg"]["after"]["held_out"] < 1.3 * 0.02 < loop["rmse_deg"]["before"]["held_out"]


def test_add_an_effect(tmp_path, monkeypatch):
    space = run_page("add-an-effect", tmp_path, monkeypatch)
    assert space["sigma"] < 0.1 * space["error"]
