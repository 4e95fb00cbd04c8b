import importlib
from pathlib import Path

import pytest
import yaml

from synth.effects import REGISTRY
from synth.errors import SpecError
from synth.section import Section
from synth.spec import Effects, read_spec

GOOD = {"recordings": [{"name": "a", "duration_s": 1.0, "command": {"kind": "step"}}]}


def written(folder: Path, **changes) -> Path:
    path = folder / "spec.yaml"
    path.write_text(yaml.safe_dump({**GOOD, **changes}))
    return path


@pytest.mark.parametrize("path", sorted(Path(__file__).parents[2].glob("configs/*.yaml")), ids=lambda path: path.name)
def test_every_shipped_spec_is_valid(path):
    read_spec(path)


def test_defaults_are_the_papers_neck(tmp_path):
    spec = read_spec(written(tmp_path))
    assert (spec.plant.a, spec.plant.b, spec.plant.c) == (26.0, 524.0, 508.0)
    assert (spec.rig.linkage.ground, spec.rig.linkage.coupler) == (0.055, 0.041)
    assert spec.seed == 0


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"effect": {}}, "unknown key effect"),
        ({"camera": {"fps": 0}}, "camera.fps"),
        ({"camera": {"size": [641, 480]}}, "even width"),
        ({"plant": {"b": -1}}, "plant.b"),
        ({"plant": {"mass": 1}}, "unknown key plant.mass"),
        ({"plant": {"kind": "neck", "mass": -2.31}}, "plant.mass"),
        ({"plant": {"kind": "neck", "spring_arm": 0.04}}, "plant: spring_arm"),
        ({"plant": {"kind": "neck"}, "effects": {"dead_zone": {"half_width_deg": 1}}}, "effects.dead_zone"),
        ({"camera": {"codec": "ffv1", "container": "mp4"}}, "camera: container"),
        ({"camera": {"interval_jitter": 0.2}}, "camera: interval_jitter"),
        ({"camera": {"exposure_s": 0.04}}, "camera: exposure_s"),
        ({"rig": {"skin": "green"}}, "rig.skin"),
        ({"rig": {"neck": "human"}}, "rig: marker"),
        ({"rig": {"neck": "human", "marker": "none"}}, "recordings.0.command: a human neck only nods"),
        ({"render": {"engine": "crayons"}}, "render.engine"),
        (
            {"effects": {"torque_saturation": {"limit": 9, "share": 0.5}, "linkage_geometry": {}}},
            "effects: torque_saturation.share",
        ),
        ({"effects": {"gremlins": {}}}, "unknown key effects.gremlins"),
        ({"effects": {"coulomb_friction": {"torque": 2.0, "breakaway": 1.0}}}, "effects.coulomb_friction: breakaway"),
        ({"effects": {"dead_time": {}}}, "effects.dead_time.tau_s"),
        ({"effects": {"dead_time": {"tau_s": float("nan")}}}, "effects.dead_time.tau_s"),
        ({"rig": {"linkage": {"crank": 0.2}}}, "rig: linkage: the four links cannot close"),
        ({"rig": {"linkage": {"lever": 0.2}}}, "unknown key rig.linkage.lever"),
        ({"recordings": []}, "recordings"),
        ({"recordings": 2 * GOOD["recordings"]}, "the name a appears twice"),
        ({"recordings": [GOOD["recordings"][0], {**GOOD["recordings"][0], "name": "A"}]}, "the name a appears twice"),
        ({"recordings": [{**GOOD["recordings"][0], "name": 300 * "a"}]}, "recordings.0.name"),
        ({"recordings": [{**GOOD["recordings"][0], "name": "a\nb"}]}, "recordings.0.name"),
        ({"camera": {"codec": "h264", "container": "avi", "dropped": 0.1}}, "camera: dropped"),
        (
            {"recordings": [{"name": "a", "duration_s": 1, "command": {"kind": "step", "hz": 3}}]},
            "unknown key recordings.0.command.hz",
        ),
        (
            {"recordings": [{"name": "../a", "duration_s": 1, "command": {"kind": "step"}}]},
            "recordings.0.name",
        ),
        (
            {"recordings": [{"name": "a", "duration_s": 1, "command": {"kind": "step", "rest_s": 0.1}}]},
            "recordings.0.command.rest_s",
        ),
    ],
)
def test_a_bad_spec_is_one_line_with_file_and_key(tmp_path, changes, key):
    path = written(tmp_path, **changes)
    with pytest.raises(SpecError) as caught:
        read_spec(path)
    line = str(caught.value)
    assert line.startswith(f"{path}: ")
    assert key in line
    assert "\n" not in line


@pytest.mark.parametrize(
    "content", [b"recordings: [", b"- 1\n", b"\xff\xfe\x00", b"", b"a: 2020-13-45\n", b"seed: 1\nseed: 2\n"]
)
def test_a_file_that_is_not_a_spec_is_one_line_too(tmp_path, content):
    path = tmp_path / "spec.yaml"
    path.write_bytes(content)
    with pytest.raises(SpecError, match=r"spec\.yaml: "):
        read_spec(path)


def test_the_reference_names_every_key_of_every_section():
    reference = (Path(__file__).parents[2] / "configs" / "README.md").read_text()
    modules = [importlib.import_module(f"synth.spec.{name}") for name in ("plant", "commands", "picture", "session")]
    sections = [Effects, *REGISTRY, *(value for module in modules for value in vars(module).values())]
    for section in sections:
        if isinstance(section, type) and issubclass(section, Section):
            for key in section.model_fields:
                assert f"{key}" in reference, f"{section.__name__}.{key}"
