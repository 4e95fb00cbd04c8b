"""Harmful rig, command, series, calibration and model files are refused in one line, with little time and memory."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from anglecam.camera.calibration import read_calibration
from anglecam.errors import AnglecamError, InputError, RigError
from anglecam.identification.export import read_model
from anglecam.io.command_csv import read_command
from anglecam.io.neck_file import read_neck
from anglecam.io.responses_json import nod_from_responses
from anglecam.io.rig import read_rig
from anglecam.io.series_csv import read_series
from anglecam.io.session import command_beside, rig_beside
from anglecam.io.tracks.files import read_tracks

READERS = {
    "rig.yaml": read_rig,
    "neck.yaml": read_neck,
    "lens.yaml": read_calibration,
    "a.command.csv": read_command,
    "a.angles.csv": read_series,
    "a.csv": read_tracks,
    "a.h5": read_tracks,
    "model.json": read_model,
    "a.responses.json": nod_from_responses,
}
LAUGHS = "".join(f"a{k}: &a{k} [{', '.join([f'*a{k - 1}' if k else 'x'] * 9)}]\n" for k in range(12))


def refusal(read, path) -> str:
    """Return the one line with which a file is refused."""
    with pytest.raises(AnglecamError) as caught:
        read(path)
    line = str(caught.value)
    assert len(line.splitlines()) == 1
    assert path.name in line
    return line


@pytest.mark.parametrize("name", READERS)
@pytest.mark.parametrize("kind", ["pipe", "folder", "nothing", "device", "binary", "sparse"])
def test_anything_but_a_text_file_is_refused_at_once(tmp_path, name, kind):
    path = tmp_path / name
    if kind == "pipe":
        os.mkfifo(path)  # to open it for reading waits until somebody writes
    elif kind == "folder":
        path.mkdir()
    elif kind == "device":
        path.symlink_to("/dev/zero")
    elif kind == "binary":
        path.write_bytes(bytes(range(256)) * 20)
    elif kind == "sparse":
        with path.open("wb") as stream:
            stream.truncate(2**40)
    refusal(READERS[name], path)


def test_a_pipe_next_to_a_clip_does_not_block(tmp_path):
    os.mkfifo(tmp_path / "rig.yaml")
    os.mkfifo(tmp_path / "a.command.csv")
    with pytest.raises(RigError, match="not an ordinary file"):
        rig_beside(tmp_path / "a.avi")
    with pytest.raises(InputError, match="not an ordinary file"):
        command_beside(tmp_path / "a.avi")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (LAUGHS, "line 1: an alias|line 2: an alias"),
        ("mouth: &a [*a]", "an alias"),
        ("held_out: " + "[" * 10_000, "more than 20 levels"),
        ("a: " * 3, "mapping values"),
        ("mouth: !!python/object/apply:os.system [ls]", "a tag"),
        ("neutral: !!timestamp x", "a tag"),
        ("neutral: " + "9" * 5_000, "not YAML|not valid"),
        ("neutral: 0x" + "f" * 5_000, "a number of 20000 bits|finite"),
        ("neutral: .inf", "neutral"),
        ("neutral: 1.0e+400", "neutral"),
        ("x" * 1_000 + ": 1", "unknown key x{60}$"),
        ('"a\\nb\\e[2J": 1', r"unknown key a\\nb\\x1b\[2J$"),
        ("facing: \x00", "not YAML"),
        ("# " + "x" * 300_000, "larger than 0.25 MiB"),
    ],
)
def test_a_rig_file_beyond_keys_and_values_is_refused(tmp_path, text, says):
    path = tmp_path / "rig.yaml"
    path.write_text(text, encoding="utf-8")
    line = refusal(read_rig, path)
    assert re.search(says, line)


def test_a_calibration_with_an_impossible_file_name_is_refused(tmp_path):
    path = tmp_path / "rig.yaml"
    path.write_text('camera: {calibration: "a\\0b"}')
    named = read_rig(path).camera.calibration
    with pytest.raises(RigError, match=r"a\\x00b: .*no file can be called that"):
        read_calibration(Path(named))


DEEP = {
    "brackets": "%YAML:1.0\n---\nK: " + "[" * 400_000,
    "closed brackets": "%YAML:1.0\n---\nK: " + "[" * 200_000 + "]" * 200_000,
    "dashes": "%YAML:1.0\n---\nK:\n " + "- " * 200_000 + "1",
    "keys": "%YAML:1.0\n---\n" + "a: " * 150_000 + "1",
    "elements": '<?xml version="1.0"?>\n<opencv_storage>' + "<a>" * 150_000,
    "JSON": '{"K": ' + "[" * 200_000 + "]" * 200_000 + "}",
}


@pytest.mark.parametrize("kind", DEEP)
def test_a_calibration_nested_without_end_does_not_end_the_process(tmp_path, kind):
    path = tmp_path / "lens.yaml"
    path.write_text(DEEP[kind])
    code = (
        "import sys\nfrom pathlib import Path\nfrom anglecam.camera.calibration import read_calibration\n"
        "from anglecam.errors import RigError\n"
        "try:\n    read_calibration(Path(sys.argv[1]))\nexcept RigError as refusal:\n    print(refusal)"
    )
    done = subprocess.run([sys.executable, "-c", code, path], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    assert "not a calibration" in done.stdout


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("head: {centre_of_mass_m: 1.0e+308}", "head.centre_of_mass_m: input should be less than"),
        ("head: {centre_of_mass_m: 1.0e-320}", "head.centre_of_mass_m: 9.99989e-321 is too small"),
        ("linkage: {ground_m: 5.0, coupler_m: 0.01, rocker_m: 0.01, crank_m: 0.01}", ""),
    ],
)
def test_an_impossible_neck_is_a_rig_error(tmp_path, text, says):
    path = tmp_path / "neck.yaml"
    path.write_text(text)
    assert says in refusal(read_neck, path)


@pytest.mark.parametrize("name", ["model.json", "a.responses.json"])
@pytest.mark.parametrize(
    "text",
    ["[" * 100_000, '{"parameters": ' * 5_000, "9" * 10_000, "[1e999]", '{"parameters": {"a_per_s": 5}}', "\x00"],
)
def test_json_that_is_no_model_is_refused(tmp_path, name, text):
    path = tmp_path / name
    path.write_text(text)
    refusal(READERS[name], path)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("time_s,command_deg\n0,1e300\n", "too large for a recording"),
        ("time_s,command_deg\n0,nan\n", "not a number"),
        ("time_s,time_s,command_deg\n0,0,1\n", "appears twice"),
        ("time_s,command_deg\n0," + "x" * 100_000 + "\n", "not a number"),
        ("time_s,command_deg\n0," + "x" * 200_000 + "\n", "field larger"),
        ("time_s,command_deg\n0,\x00\n", "not a number"),
        ("\x00" * 1000, "no column time_s"),
        ('time_s,command_deg\n0,"1\n2\n', "not a number"),
    ],
)
def test_a_hostile_table_is_one_short_line(tmp_path, text, says):
    path = tmp_path / "a.command.csv"
    path.write_text(text)
    line = refusal(read_command, path)
    assert says in line
    assert len(line) < 400 + len(str(path))


def test_a_table_may_have_a_million_rows_and_no_more(tmp_path, monkeypatch):
    monkeypatch.setattr("anglecam.io.csv_columns._MOST_ROWS", 5)
    path = tmp_path / "a.command.csv"
    path.write_text("time_s,command_deg\n" + "".join(f"{k},0\n" for k in range(5)))
    assert len(read_command(path).time) == 5
    path.write_text("time_s,command_deg\n" + "".join(f"{k},0\n" for k in range(6)))
    assert "more than 5 rows" in refusal(read_command, path)
