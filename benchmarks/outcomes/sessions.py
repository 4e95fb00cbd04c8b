"""The sessions of the loop: those of `synth`'s specs, of other simulators, and measured ones."""

from __future__ import annotations

import hashlib
import json
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from anglecam.data.record import Record
from anglecam.errors import AnglecamError
from anglecam.io.session import read_session
from anglecam.loop.close import close_records
from anglecam.loop.verdict import Verdict
from anglecam.workflow.session import close_session, measure_session
from benchmarks import measured, mechanisms, real_data
from benchmarks.blind.judged import exactly, judge, true_values
from benchmarks.blind.sessions import filmed
from benchmarks.blind.simulated import KINDS
from benchmarks.outcomes.case import Meter, Places, Row, known, sha256, status_of
from synth.effects.constant_torque import ConstantTorque
from synth.spec import Spec, read_spec

CONFIGS = Path(__file__).parents[2] / "configs"
OTHERWISE = ("hard-", "human-nod")
"""Specs whose difficulty is in the picture, and one without a plant."""
SIGMA_DEG = 0.05
"""Noise of the angle in sessions of `synth`'s specs, °."""
SEED = 0
"""Of the mechanisms of other simulators."""
PENDULUM = "single-pendulum"


def names(places: Places) -> list[str]:
    """Return the sessions; the measured ones only where their folder is."""
    specs = [f"spec {path.stem}" for path in sorted(CONFIGS.glob("*.yaml")) if not path.stem.startswith(OTHERWISE)]
    simulated = [f"mechanism {kind}" for kind in KINDS]
    if places.real is None:
        return specs + simulated
    sets = [f"measured {name}" for name in (*measured.MECHANISMS, PENDULUM) if (places.real / name).exists()]
    series = [f"series {path.parent.name}" for path in sorted(places.real.glob("series/*/NOTES.md"))]
    return series + specs + simulated + sets


def session(name: str, places: Places, meter: Meter) -> Row:
    """Close the loop on one session."""
    kind, which = name.split(" ", 1)
    if kind == "spec":
        return _of_spec(read_spec(CONFIGS / f"{which}.yaml"), meter)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        if kind == "mechanism":
            mechanisms.write(which, SEED, folder, with_sigma=True)
        elif kind == "series":
            assert places.real is not None
            for path in (places.real / "series" / which).iterdir():
                (folder / path.name).write_bytes(path.read_bytes())
        else:
            assert places.real is not None
            writers = {key: one.write for key, one in measured.MECHANISMS.items()} | {
                PENDULUM: real_data.write_pendulum
            }
            writers[which](places.real / which, folder)
        unused: list[str] = []

        def close() -> Verdict:
            found = measure_session(read_session(folder))
            unused.extend(map(str, found.problems))
            return close_session(found)

        row, verdict = _closed(meter, close)
        row["session"] = sha256(*sorted(path for path in folder.iterdir() if path.suffix in (".csv", ".yaml")))
        said = "; ".join(filter(None, (*unused, row["message"])))
        row["message"] = said.replace(f"{folder}/", "").replace(str(folder), which)
    if kind == "mechanism" and verdict is not None:
        row["verdict"] = "right" if mechanisms.is_right(which, verdict) else "wrong"
    return row


def _of_spec(spec: Spec, meter: Meter) -> Row:
    records = filmed(spec, known=spec.effects.get(ConstantTorque) is not None, sigma_deg=SIGMA_DEG)
    row, verdict = _closed(meter, lambda: close_records(records, held_out=spec.declare["held_out"]))
    row["session"] = _hash_of(records)
    if verdict is not None:
        true = spec.effects.model_dump(exclude_none=True)
        line = judge(verdict, true, true_values(spec, true), SIGMA_DEG)
        row["verdict"] = "right" if exactly(line) else "wrong"
        row["off_sigmas"] = {key: one["off_sigmas"] for key, one in line["estimates"].items()}
    return row


def _closed(meter: Meter, close: Callable[[], Verdict]) -> tuple[Row, Verdict | None]:
    """Close a session; return its row and the verdict, ``None`` where there is none."""
    try:
        with meter():
            verdict = close()
    except AnglecamError as problem:
        return {"status": status_of(str(problem)), "message": str(problem)}, None
    effects = {
        accepted.effect.id: {p.name: verdict.parameters[p.name] for p in accepted.effect.parameters}
        for accepted in verdict.accepted
    }
    before, after = verdict.before_held_out.rmse, verdict.after_held_out.rmse
    return {
        "status": "ok",
        "message": "",
        "loop_verdict": verdict.verdict,
        "effects": effects,
        "aliases": [list(accepted.alias_set) for accepted in verdict.accepted],
        "free_form": None if verdict.free_form is None else list(verdict.free_form.over),
        "before_deg": known(float(np.degrees(before))),
        "error_deg": known(float(np.degrees(after))),
    }, verdict


def _hash_of(records: Sequence[Record]) -> str:
    parts = [json.dumps([r.name, r.time.tolist(), r.angle.tolist()]) for r in records]
    return hashlib.sha256("".join(parts).encode()).hexdigest()[:32]
