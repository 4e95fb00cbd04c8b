"""Every JSON document that anglecam writes is valid by its schema, and the schema describes every key in it.

A document is validated twice: as anybody would, and with further keys forbidden, so that no key is undocumented.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from dataclasses import asdict, fields
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from referencing import Registry, Resource

from anglecam.batch.row import Row
from anglecam.budget.gum import propagate
from anglecam.camera.calibrate import BoardCalibration
from anglecam.camera.calibration import Calibration
from anglecam.certificate.certificate_json import certificate_as_dict
from anglecam.certificate.certify import NO_LAMP, Certificate, Certified
from anglecam.certificate.quantity import QUANTITIES
from anglecam.cli.app import main
from anglecam.cli.documents import calibration_as_dict, live_as_dict
from anglecam.data.command import Command
from anglecam.data.series import AngleSeries
from anglecam.io.files import json_text, write_json
from anglecam.io.live_csv import LiveRow
from anglecam.io.series_csv import write_series
from anglecam.loop.cross_validation import Gain, Prediction
from anglecam.loop.free_form.band import Band
from anglecam.loop.free_form.result import FreeForm
from anglecam.loop.next_experiment.design import Experiment
from anglecam.loop.verdict_json import free_form_as_dict
from anglecam.workflow.live import LiveResult
from anglecam.workflow.self_test import write_film
from support.drawn import Plant
from support.series import session as make_records

SCHEMAS = {
    path.name.removesuffix(".schema.json"): json.loads(path.read_text())
    for path in sorted((files("anglecam.io") / "schemas").iterdir(), key=lambda path: path.name)
}
FILES = {"model", "loop", "budget", "responses", "check", "certificate"}
EXPERIMENT = Experiment(Command(np.array([0.0, 1.0]), np.array([0.0, 0.1])), "a step", 3.0, {("a", "b"): 5.0})
COMMANDS = {
    *("check", "measure", "live", "budget", "calibrate", "identify", "close", "certify", "export", "batch", "doctor"),
}


def strict(schema: Any) -> Any:
    """Return a schema in which an object has no other keys than those described."""
    if isinstance(schema, list):
        return [strict(part) for part in schema]
    if not isinstance(schema, dict):
        return schema
    copied = {key: strict(part) for key, part in schema.items()}
    return {"additionalProperties": False} | copied if "properties" in schema and "type" in schema else copied


def faults(name: str, content: Any) -> list[str]:
    """Return what is wrong with a document by its schema, with and without further keys."""
    document = json.loads(json_text(content))
    found = []
    for form in (lambda schema: schema, strict):
        registry = Registry().with_resources((s["$id"], Resource.from_contents(form(s))) for s in SCHEMAS.values())
        validator = Draft202012Validator(form(SCHEMAS[name]), registry=registry)
        found += [f"{fault.json_path}: {fault.message[:200]}" for fault in validator.iter_errors(document)]
    return found


def call(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, Any]:
    """Run a command with ``--json`` in this process; return its exit status and its document."""
    capsys.readouterr()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["anglecam", *map(str, arguments), "--json"])
        with pytest.raises(SystemExit) as ended:
            main()
    return int(ended.value.code or 0), json.loads(capsys.readouterr().out)


@pytest.fixture(scope="module")
def clip(tmp_path_factory) -> Path:
    """Film a second in which a stick moves from rest to rest."""
    path = tmp_path_factory.mktemp("film") / "swing.mkv"
    write_film(path, np.radians(10.0) * np.clip(np.arange(40) / 4.0 - 4.0, -1.0, 1.0))
    return path


@pytest.fixture(scope="module")
def session(tmp_path_factory) -> Path:
    """Write a session of angle series of a plant that answers 40 ms late."""
    folder = tmp_path_factory.mktemp("session")
    for record in make_records(Plant(dead_time_s=0.04), 4, duration_s=5.0):
        if record.name not in ("stairs", "chirp"):
            continue
        n = len(record.time)
        write_series(
            AngleSeries(record.name, record.time, record.angle, np.full(n, np.radians(0.05)), ("ok",) * n),
            folder / f"{record.name}.angles.csv",
        )
        rows = np.column_stack([record.command.time, np.degrees(record.command.angle)])
        np.savetxt(folder / f"{record.name}.command.csv", rows, "%.6f", ",", header="time_s,command_deg", comments="")
    return folder


def test_there_is_a_schema_for_each_file_and_each_command():
    assert set(SCHEMAS) == FILES | {f"{command}.output" for command in COMMANDS}


@pytest.mark.parametrize("name", SCHEMAS)
def test_every_key_has_a_description_and_every_number_a_unit(name):
    Draft202012Validator.check_schema(SCHEMAS[name])

    def missing(schema: Any, path: str) -> Iterator[str]:
        if not isinstance(schema, dict):
            return
        for key, part in schema.get("properties", {}).items():
            if "description" not in part:
                yield f"{path}.{key}: description"
            kinds = np.atleast_1d(part.get("type", "")).tolist()
            if {"number", "integer"} & set(kinds) and "unit" not in part:
                yield f"{path}.{key}: unit"
            yield from missing(part, f"{path}.{key}")
        for part in (schema.get("items"), schema.get("additionalProperties"), *schema.get("$defs", {}).values()):
            yield from missing(part, path)

    assert list(missing(SCHEMAS[name], name)) == []


def test_measure(clip, tmp_path, capsys):
    status, document = call(capsys, "measure", clip, "--out", tmp_path)
    assert status == 0
    assert faults("measure.output", document) == []
    assert len(document["clips"][0]["responses"]) == 1
    assert faults("responses", json.loads((tmp_path / "swing.responses.json").read_text())) == []


def test_budget(clip, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("anglecam.budget.clip.propagate", partial(propagate, most=50_000))
    status, document = call(capsys, "budget", clip, "--out", tmp_path)
    assert status == 0
    assert faults("budget.output", document) == []
    assert faults("budget", json.loads((tmp_path / "swing.budget.json").read_text())) == []


@pytest.mark.parametrize("estimator", ["oe3", "neck"])
def test_identify(session, tmp_path, capsys, estimator):
    status, document = call(capsys, "identify", session, "--out", tmp_path, "--estimator", estimator)
    assert status == 0
    assert faults("identify.output", document) == []
    assert faults("model", json.loads((tmp_path / "model.json").read_text())) == []


def test_close(session, tmp_path, capsys):
    status, document = call(capsys, "close", session, "--out", tmp_path)
    assert status == 0
    assert faults("close.output", document) == []
    written = json.loads((tmp_path / "loop.json").read_text())
    assert document["loop"] == written
    assert [effect["id"] for effect in written["effects"]] == ["dead_time"]
    for model in ("model.json", "ekf.json"):
        assert faults("model", json.loads((tmp_path / model).read_text())) == []
    assert faults("loop", written | {"free_form": free_form_as_dict(free_form())}) == []
    assert faults("loop", written | {"free_form": None}) == []


def test_certificate(closed):
    certified = tuple(
        Certified(quantity, None, (-np.inf, np.inf), False, (), experiment)
        for quantity, experiment in zip(QUANTITIES, [EXPERIMENT, *(len(QUANTITIES) - 1) * [None]], strict=True)
    )
    content = certificate_as_dict(Certificate(closed("late"), certified, NO_LAMP))
    written = {"session": "servo", **content, "files": [{"file": "stairs.angles.csv", "sha256": "0" * 64}]}
    assert faults("certificate", written) == []
    assert faults("certify.output", {"problems": [], "certificate": written}) == []


def test_check_and_export(clip, session, tmp_path, capsys):
    status, document = call(capsys, "check", clip, "--out", tmp_path)
    assert status == 0
    assert faults("check.output", document) == []
    assert faults("check", json.loads((tmp_path / "swing.check.json").read_text())) == []
    assert call(capsys, "identify", session, "--out", tmp_path)[0] == 0
    status, document = call(capsys, "export", tmp_path / "model.json", "--to", "urdf")
    assert status == 0
    assert faults("export.output", document) == []


def free_form() -> FreeForm:
    """Return a torque over angle and phase, at three points."""
    before = Prediction((), (np.array([0.1, -0.1]),), 0.02)
    band = Band(("angle", "phase"), (np.zeros(3), np.zeros(3)), np.ones(3), np.array([0.1, np.nan, 0.1]), np.ones(3))
    return FreeForm(band, None, before, before, Gain(0.5, (0.4, 0.6), 0.4), {"cogging": 0.9})


def test_live_and_calibrate(tmp_path):
    series = AngleSeries("nod", np.arange(2.0), np.zeros(2), np.ones(2), ("ok", "ok"))
    rows = (LiveRow(0, 0.0, "learning"), LiveRow(1, 0.1, "ok", angle=0.1, sigma=0.01, latency=0.02))
    for shown in (rows, rows[:1]):
        result = LiveResult(tmp_path / "nod.mkv", shown, type("Measured", (), {"series": series})(), None)
        assert faults("live.output", {"problems": [], "live": live_as_dict(result)}) == []
    calibration = Calibration((640, 480), np.eye(3), np.zeros(5), None, 0.2, 12)
    found = BoardCalibration(calibration, ("k1",), {"k1": 0.3}, (), 1, 0.9, ("mind",))
    document = {"problems": [], "calibration": calibration_as_dict(tmp_path / "nod.calibration.yaml", found)}
    assert faults("calibrate.output", document) == []


def test_batch():
    keys = SCHEMAS["batch.output"]["properties"]["clips"]["items"]["properties"]
    assert list(keys) == [field.name for field in fields(Row)]
    rows = [asdict(Row(path="a.avi", cause="no such file")), asdict(Row(path="b.avi", frames=3, status="ok"))]
    assert faults("batch.output", {"problems": [], "clips": rows, "index": "index.csv"}) == []


@pytest.mark.parametrize("command", sorted(COMMANDS - {"doctor"}))
def test_a_failure_is_a_document_too(command, tmp_path, capsys):
    further = ("--to", "urdf") if command == "export" else ()
    status, document = call(capsys, command, tmp_path / "nowhere", "--out", tmp_path / "out", *further)
    assert status in (1, 2)
    assert len(document["problems"]) == 1
    assert faults(f"{command}.output", document) == []


def test_an_undocumented_key_is_found(tmp_path):
    write_json(tmp_path / "x.json", {"problems": [], "surprise": 1})
    assert faults("doctor.output", json.loads((tmp_path / "x.json").read_text())) != []
