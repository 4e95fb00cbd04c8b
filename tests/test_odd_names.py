"""Whatever a clip is called: its results go where they belong, and what is said of it stays on one line."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from anglecam.data.series import AngleSeries
from anglecam.errors import InputError, printable
from anglecam.io.files import write_atomically, write_whole
from anglecam.io.netcdf_parquet import Also, write_also
from anglecam.io.series_csv import read_series, write_series
from anglecam.report.figures import plot_series
from support.tiny import tiny_clip

COMMAND = "from anglecam.cli.app import main; main()"
NAMES = [
    "line\nbreak",
    "escape\x1b[2J",
    "bell\x07 and\ttab",
    "separator\u2028",
    "..",
    "...",
    "-rf",
    "[red]",
    "[bold]",
    ":boom:",
    "$x_{",
    "<script>",
    "concat:a|b",
    "%d",
    "a" * 230,
    os.fsdecode(b"latin-\xe9"),
]


def _series(name: str) -> AngleSeries:
    n = 30
    places = np.tile([50.0, 40.0], (n, 1))
    angle = np.radians(np.linspace(0.0, 5.0, n))
    sigma = np.full(n, 1e-4)
    bounds = {6.0: np.full(n, 0.05), 10.0: np.full(n, 0.1)}
    return AngleSeries(name, np.arange(n) / 30, angle, sigma, ("ok",) * n, angle, places, places, bounds)


@pytest.mark.parametrize("name", NAMES, ids=ascii)
def test_every_file_of_results_goes_into_the_folder_for_results(tmp_path, name):
    out = tmp_path / "out"
    series = _series(name)
    write_series(series, out / f"{name}.angles.csv")
    write_also(series, (Also.netcdf, Also.parquet), out / name)
    plot_series(series, out / f"{name}.png")
    endings = (".angles.csv", ".angles.nc", ".angles.parquet", ".png")
    assert {path.name for path in out.iterdir()} == {f"{name}{ending}" for ending in endings}
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    assert len(read_series(out / f"{name}.angles.csv").time) == 30


def test_a_name_as_long_as_names_may_be_is_written(tmp_path):
    path = tmp_path / ("é" * 127)
    with write_atomically(path) as stream:
        stream.write("text")
    with write_whole(path) as unfinished:
        unfinished.write_text("text")
    assert path.read_text() == "text"


@pytest.mark.parametrize("name", NAMES, ids=ascii)
def test_a_failure_is_one_line_that_names_the_file(tmp_path, name):
    line = str(InputError(f"{tmp_path / name}.avi: no mouth"))
    assert len(line.splitlines()) == 1
    assert line.isprintable()
    assert line.endswith(": no mouth")
    assert line.encode()
    assert name not in (n for n in NAMES if n.isprintable()) or name in line


def test_what_anybody_can_read_is_left_as_it_is():
    assert printable("Kopfnicken über 10° – Länge.avi") == "Kopfnicken über 10° – Länge.avi"


@pytest.mark.sweep  # a clip of any name is also measured in `tests/batch/test_trouble.py`
def test_a_folder_of_odd_names_is_measured_a_line_for_each_that_cannot_be(tmp_path):
    folder, out = tmp_path / "clips", tmp_path / "out"
    folder.mkdir()
    film = tiny_clip(folder / "plain.avi").read_bytes()
    good = ["[red] :boom: $x_{\n", os.fsdecode(b"latin-\xe9")]
    for name in good:
        (folder / f"{name}.avi").write_bytes(film)
    for name in NAMES:
        (folder / f"{name}.mov").write_text("no film")
    (folder / f"{'a' * 251}.avi").write_bytes(film)  # what its results would be called is too long
    asked = [sys.executable, "-c", COMMAND, "measure", str(folder), "--out", str(out)]
    done = subprocess.run(
        asked, capture_output=True, text=True, errors="surrogateescape", timeout=120, check=False,
        env=os.environ | {"LC_ALL": "C.UTF-8"},
    )  # fmt: skip
    assert done.returncode == 1, done.stderr
    lines = done.stderr.splitlines()
    assert len(lines) == len(NAMES) + 1, done.stderr
    assert all(line.isprintable() and str(folder) in line for line in lines)
    assert "File name too long" in done.stderr
    assert "internal error" not in done.stderr
    for name in (*good, "plain"):
        assert (out / f"{name}.angles.csv").exists()
    assert {path.parent for path in Path(tmp_path).rglob("*.csv")} == {out}
