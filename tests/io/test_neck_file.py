"""A neck declared in a file: the paper's by default, every key read, an unknown one named."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from anglecam.errors import RigError
from anglecam.io.neck_file import NeckFile, ThrustBearing, read_neck
from anglecam.neck.command_table import TABLE_3
from anglecam.neck.damping import OilFilm
from anglecam.neck.large_angle import LargeAngleNeck
from anglecam.neck.parameters import PAPER
from anglecam.neck.turning import TurningMechanism
from anglecam.neck.variation import nod_slope

SHIPPED = Path(__file__).parents[2] / "configs" / "necks" / "paper.yaml"


def read_text_as_neck(folder, text):
    path = folder / "neck.yaml"
    path.write_text(text)
    return read_neck(path)


def test_defaults_are_the_papers_neck(tmp_path):
    for neck in (read_neck(None), read_text_as_neck(tmp_path, "")):
        assert neck.parameters == PAPER
        assert neck.large_angle == LargeAngleNeck()
        assert (neck.scale, neck.turning) == (TABLE_3, TurningMechanism())
        assert (neck.bearing, neck.film) == (ThrustBearing(), OilFilm())
        assert neck.known["inertia"].value == 0.0058
        assert neck.example.head.mass == 2.319
        assert neck.example.damping == pytest.approx(0.0530, abs=5e-5)


def test_the_shipped_file_names_every_key_and_is_the_paper():
    neck, paper = read_neck(SHIPPED), read_neck(None)
    assert neck.parameters.linkage == PAPER.linkage
    assert neck.parameters.servo == PAPER.servo
    assert neck.parameters.head == PAPER.head
    assert (neck.parameters, neck.large_angle) == (PAPER, paper.large_angle)
    assert (neck.turning, neck.bearing, neck.film) == (paper.turning, paper.bearing, paper.film)
    assert neck.scale.up == pytest.approx(TABLE_3.up, rel=1e-15)
    assert neck.scale.down == pytest.approx(TABLE_3.down, rel=1e-15)
    text = SHIPPED.read_text()
    for name, field in NeckFile.model_fields.items():
        assert f"\n{name}:" in text, name
        section = getattr(field.default, "model_fields_set", None)
        for key in type(field.default).model_fields if section is not None else ():
            assert f"{key}:" in text, key


def test_declared_keys_are_taken_in_their_units(tmp_path):
    neck = read_text_as_neck(
        tmp_path,
        "head: {mass_kg: 1.5, neutral_deg: 30}\nspring: {rate_N_per_m: 900, common_stretch_m: 0.02}\n"
        "linkage_slope: exact\nsigma: {mass_kg: 0.01, neutral_deg: 2}\ndamping_N_m_s: 0.2\n",
    )
    head = neck.parameters.head
    assert (head.mass, head.neutral) == (1.5, pytest.approx(math.radians(30.0)))
    assert neck.large_angle.common_stretch == 0.02
    assert neck.large_angle.gamma == "exact"
    assert neck.parameters == neck.example == replace(neck.parameters, damping=0.2)
    assert neck.known["inertia"].value == pytest.approx(head.inertia)
    assert neck.known["inertia"].sigma == pytest.approx(0.01 * 0.05**2)
    weight = neck.known["weight"]
    slopes = weight.value / 1.5 * 0.01, weight.value * math.tan(head.neutral) * math.radians(2.0)
    assert weight.sigma == pytest.approx(math.hypot(*slopes))


def test_declared_links_set_the_slope(tmp_path):
    neck = read_text_as_neck(tmp_path, "linkage: {rocker_m: 0.056}\n")
    assert neck.parameters.gamma == nod_slope(neck.parameters.linkage)
    assert neck.parameters.gamma != PAPER.gamma
    assert read_text_as_neck(tmp_path, "linkage: {rocker_m: 0.056}\ngamma: -0.4\n").parameters.gamma == -0.4


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("spring: {rate: 3}\n", "neck.yaml: unknown key spring.rate"),
        ("mass: 3\n", "neck.yaml: unknown key mass"),
        ("head: {mass_kg: -1}\n", "neck.yaml: head.mass_kg: input should be greater than 0 (got -1)"),
        ("gamma: steep\n", "neck.yaml: gamma"),
        ("- 1\n", "neck.yaml: expected keys and values, found a list"),
        ("a: [1\n", "neck.yaml: not YAML"),
    ],
)
def test_an_error_names_the_file_and_the_key(tmp_path, text, says):
    with pytest.raises(RigError) as fault:
        read_text_as_neck(tmp_path, text)
    assert says in str(fault.value)
    assert "\n" not in str(fault.value)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(RigError, match=r"none.yaml: cannot be read"):
        read_neck(tmp_path / "none.yaml")
