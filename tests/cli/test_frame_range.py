"""A range of frames, from the rig file or the command line: its rows keep their numbers and times in every result."""

from __future__ import annotations

import csv
import json
import sys
from functools import partial

import numpy as np
import pytest

from anglecam.budget.gum import propagate
from anglecam.cli import app as cli
from anglecam.errors import RigError
from anglecam.io.netcdf_parquet import read_netcdf
from anglecam.io.rig import read_rig
from anglecam.io.series_csv import read_series
from anglecam.video.open_film import open_film
from support import things

SWING_DEG = 20.0 * np.sin(np.arange(60) / 5.0)


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    """Film a ball that swings in frames 12 to 47; before and after, it is covered by a hand."""
    folder = tmp_path_factory.mktemp("film")
    swing, hand = things.ball((200, 40, 40), 12.0), iter(range(60))

    def draw(scene, angle):
        swing(scene, angle)
        if not 12 <= next(hand) < 48:
            scene[300:] = (90, 120, 160)

    return things.film(folder / "swing.mkv", draw, SWING_DEG)


@pytest.fixture
def status(monkeypatch, capsys):
    """Return a function that calls anglecam as a user does and gives (exit status, standard error)."""

    def call(*arguments: object) -> tuple[int, str]:
        monkeypatch.setattr(sys, "argv", ["anglecam", *map(str, arguments)])
        with pytest.raises(SystemExit) as left:
            cli.main()
        return int(left.value.code or 0), capsys.readouterr().err

    return call


def _rows(path) -> list[dict[str, str]]:
    with path.open() as stream:
        return list(csv.DictReader(stream))


def test_the_rows_of_a_range_keep_their_numbers_and_times(clip, tmp_path, status):
    code, told = status("measure", clip, "--from", 12, "--to", 47, "--out", tmp_path, "--overlay", "--also", "netcdf")
    assert code == 0, told
    rows = _rows(tmp_path / "swing.angles.csv")
    assert [int(row["frame"]) for row in rows] == list(range(12, 48))
    assert {row["status"] for row in rows} == {"ok"}
    np.testing.assert_allclose([float(row["time_s"]) for row in rows], np.arange(12, 48) / 30.0, atol=1e-3)
    off = np.array([float(row["angle_deg"]) for row in rows]) - SWING_DEG[12:48]
    assert np.std(off) < 0.1
    assert read_netcdf(tmp_path / "swing.angles.nc").first_frame == 12
    assert read_series(tmp_path / "swing.angles.csv").first_frame == 12
    overlay = list(open_film(tmp_path / "swing.overlay.mp4").frames())
    assert len(overlay) == 36
    assert overlay[0].time == pytest.approx(12 / 30.0, abs=1e-3)


def test_the_rig_files_range_holds_and_the_command_line_overrides_it(clip, tmp_path, status, monkeypatch):
    monkeypatch.setattr("anglecam.budget.clip.propagate", partial(propagate, most=50_000))
    rig = tmp_path / "rig.yaml"
    rig.write_text("frames: {from: 12, to: 47}\n")
    assert status("budget", clip, "--rig", rig, "--from", 20, "--out", tmp_path) == (0, "")
    budget = json.loads((tmp_path / "swing.budget.json").read_text())
    assert budget["frames_measured"] == 28
    assert 20 <= budget["typical"]["frame"] <= 47
    assert 20 <= budget["worst"]["frame"] <= 47


@pytest.mark.parametrize(
    ("range_", "code", "cause"),
    [
        (
            ("--from", 60),
            1,
            "swing.mkv: the film has 60 frames, numbered from 0 to 59; frame 60 was asked for as the first",
        ),
        (
            ("--to", 60),
            1,
            "swing.mkv: the film has 60 frames, numbered from 0 to 59; frame 60 was asked for as the last",
        ),
        (("--from", 30, "--to", 20), 2, "no frame lies from 30 to 20"),
        (("--from", -1), 2, "--from"),
    ],
)
def test_a_range_without_frames_is_one_line(clip, tmp_path, status, range_, code, cause):
    found, told = status("measure", clip, *range_, "--out", tmp_path)
    assert found == code
    assert cause in told
    assert "film it with" not in told
    assert "Traceback" not in told


@pytest.mark.parametrize(("key", "asked"), [("from", "the first"), ("to", "the last")])
def test_a_frame_of_the_rig_that_the_film_does_not_have_is_one_line(clip, tmp_path, status, key, asked):
    rig = tmp_path / "rig.yaml"
    rig.write_text(f"frames: {{{key}: 400}}")
    found, told = status("measure", clip, "--rig", rig, "--out", tmp_path)
    assert found == 1
    assert f"60 frames, numbered from 0 to 59; frame 400 was asked for as {asked}" in told


@pytest.mark.parametrize(
    ("text", "cause"),
    [
        ("frames: {from: 30, to: 20}", "to: 20 comes before from: 30"),
        ("frames: {from: -1}", "frames.from"),
        ("frames: {first: 3}", "unknown key frames.first"),
        ("frames: {rate_hz: 0}", "frames.rate_hz"),
    ],
)
def test_a_wrong_range_in_the_rig_file_names_its_key(tmp_path, text, cause):
    rig = tmp_path / "rig.yaml"
    rig.write_text(text)
    with pytest.raises(RigError, match=cause):
        read_rig(rig)


def test_a_folder_of_numbered_pictures_is_one_clip_of_the_call(clip, tmp_path, status):
    import cv2

    folder = tmp_path / "run"
    folder.mkdir()
    for frame in open_film(clip).frames():
        cv2.imwrite(str(folder / f"run{frame.index}.png"), frame.image)
    code, told = status("measure", folder, "--out", tmp_path / "out")
    assert code == 2
    assert "declare frames: {rate_hz" in told
    (folder / "rig.yaml").write_text("frames: {rate_hz: 60, from: 12, to: 47}\n")
    assert status("measure", folder, "--out", tmp_path / "out") == (0, "")
    rows = _rows(tmp_path / "out" / "run.angles.csv")
    assert float(rows[0]["time_s"]) == pytest.approx(12 / 60.0)
