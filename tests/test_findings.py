"""A wrong file is reported with every wrong key at once, by its path in the file and with the key that was meant."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest
import yaml

import anglecam
from anglecam.errors import RigError
from anglecam.io.neck_file import read_neck
from anglecam.io.rig import read_rig
from synth.errors import SpecError
from synth.spec import read_spec

WRONG_RIG = """
moth: auto
mark: {rgb: [300, 2, 3]}
pivot: {neer: [1, 2], marker: square}
facing: up
neutral: x
camera: {tilt: 3, row_time_s: -1}
"""


def lines_of(read, path: Path, text: str, kind: type[Exception] = RigError) -> list[str]:
    path.write_text(text)
    with pytest.raises(kind) as caught:
        read(path)
    lines = str(caught.value).splitlines()
    assert all(line.startswith(f"{path}: ") for line in lines)
    return [line.removeprefix(f"{path}: ") for line in lines]


def test_a_rig_file_has_a_line_for_each_wrong_key(tmp_path):
    assert lines_of(read_rig, tmp_path / "rig.yaml", WRONG_RIG) == [
        "unknown key pivot.neer; did you mean near?",
        "unknown key camera.tilt; did you mean tilt_deg?",
        "unknown key moth; did you mean mouth?",
        "mouth.rgb.0: input should be less than or equal to 255 (got 300)",
        "pivot.marker: input should be 'auto', 'disc', 'ring' or 'none' (got square)",
        "facing: input should be 'right' or 'left' (got up)",
        "neutral: input should be a valid number, unable to parse string as a number (got x)",
        "camera.row_time_s: input should be greater than 0 (got -1)",
    ]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("marc: auto", "unknown key marc; did you mean mark?"),
        ("frames: {form: 3}", "unknown key frames.form; did you mean from?"),
        ("mouth: {rbg: [1, 2, 3]}", "unknown key mouth.rbg; did you mean rgb?"),
        ("pivot: {zzz: 1}", "unknown key pivot.zzz"),
        ("mouth: 3", "mouth: input should be a valid dictionary or instance of RigMark (got 3)"),
    ],
)
def test_the_key_that_was_meant_is_named(tmp_path, text, line):
    assert lines_of(read_rig, tmp_path / "rig.yaml", text) == [line]


def test_a_neck_file_too(tmp_path):
    text = "spring: {rat_N_per_m: 3}\nhead: {mass_kg: -1}"
    assert lines_of(read_neck, tmp_path / "neck.yaml", text) == [
        "unknown key spring.rat_N_per_m; did you mean rate_N_per_m?",
        "head.mass_kg: input should be greater than 0 (got -1)",
    ]


def test_a_spec_too(tmp_path):
    content = {
        "effects": {"ded_time": {}, "backlash": {"half_width": 1}},
        "rig": {"linkage": {"crnk": 0.2}},
        "camera": {"fps": 0},
        "recordings": [
            {"name": "a", "duration_s": 1, "command": {"kind": "step", "amplitude": 3}},
            {"name": "b", "duration_s": 1, "command": {"kind": "stpe"}},
        ],
    }
    lines = lines_of(read_spec, tmp_path / "spec.yaml", yaml.safe_dump(content), SpecError)
    assert "unknown key effects.ded_time; did you mean dead_time?" in lines
    assert "unknown key effects.backlash.half_width; did you mean half_width_deg?" in lines
    assert "unknown key rig.linkage.crnk; did you mean crank?" in lines
    assert "unknown key recordings.0.command.amplitude; did you mean amplitude_deg?" in lines
    assert "camera.fps: input should be greater than 0 (got 0)" in lines
    assert any(line.startswith("recordings.1.command.kind: ") and line.endswith("did you mean step?") for line in lines)


def test_a_rig_in_python_is_checked_the_same_way():
    with pytest.raises(RigError) as caught:
        anglecam.measure("clip.avi", rig={"pivott": {}, "facing": "up"})
    assert str(caught.value) == (
        "rig: unknown key pivott; did you mean pivot?\nrig: facing: input should be 'right' or 'left' (got up)"
    )


def test_a_rig_may_be_a_path(tmp_path):
    with pytest.raises(RigError, match=r"nowhere\.yaml: cannot be read"):
        anglecam.measure("clip.avi", rig=tmp_path / "nowhere.yaml")


def test_all_lines_survive_a_process_boundary():
    error = pickle.loads(pickle.dumps(RigError("a: 1", "b\n: 2")))
    assert str(error) == "a: 1\nb\\n: 2"
    assert error.one_line == "a: 1; b\\n: 2"
