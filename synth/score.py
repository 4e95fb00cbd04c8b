"""Compares anglecam's results with the truth: angles clip by clip, the model, the effects, the held-out error."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from synth.errors import SpecError

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ClipScore:
    """Error of the measured angles of one clip."""

    name: str
    rms_deg: float
    """RMS error over the frames with status ok; nan if there are none."""
    offset_deg: float | None
    """Median difference, subtracted first: the zero of a clip without a command is the clip's median angle."""
    ok: int
    frames: int
    """Number of frames in the truth."""


def score_clip(found: Path, truth: Path, has_command: bool) -> ClipScore:
    """Compare one ``NAME.angles.csv`` with its ``NAME.truth.csv``.

    Parameters
    ----------
    found, truth : Path
        The two files.
    has_command : bool
        Whether the clip has a command; without a command the zero of the angle is a convention, not a measurement.

    Returns
    -------
    ClipScore
        In degrees.

    Raises
    ------
    SpecError
        If the measured file is missing a column or holds no numbers.
    """
    true = {row["frame"]: float(row["angle_deg"]) for row in _rows(truth)}
    measured = _rows(found)
    try:
        good = [row for row in measured if row["status"] == "ok" and row["frame"] in true]
        errors = np.array([float(row["angle_deg"]) - true[row["frame"]] for row in good])
    except (KeyError, ValueError) as error:
        raise SpecError(f"{found}: not a table of angles ({error})") from error
    offset = None
    if not has_command and len(errors):
        offset = float(np.median(errors))
        errors = errors - offset
    rms = float(np.sqrt(np.mean(errors**2))) if len(errors) else math.nan
    return ClipScore(found.name.removesuffix(".angles.csv"), rms, offset, len(errors), len(true))


def score(result: Path, truth: Path, console: Console) -> None:
    """Print every comparison that the files in `result` allow.

    Parameters
    ----------
    result : Path
        Folder written by ``anglecam close`` or ``measure``.
    truth : Path
        Folder written by ``synth render --truth``.
    console : rich.console.Console
        Prints the tables.

    Raises
    ------
    SpecError
        If a folder does not contain the expected files.
    """
    facts = _json(truth / "truth.json")
    if facts is None:
        raise SpecError(f"{truth}: no truth.json in it; was it written by synth render --truth?")
    clips = [
        score_clip(path, truth / f"{name}.truth.csv", recording["command"]["kind"] not in {"free", "nod"})
        for name, recording in facts["recordings"].items()
        if (path := result / f"{name}.angles.csv").exists()
    ]
    models = {name: _json(result / f"{name}.json") for name in ("ekf", "model")}
    loop = _json(result / "loop.json")
    if not clips and loop is None and not any(models.values()):
        raise SpecError(f"{result}: neither NAME.angles.csv nor loop.json nor model.json in it")
    if clips:
        console.print(_clip_table(clips))
        if any(clip.offset_deg is not None for clip in clips):
            console.print("clips without a command have their own median as zero: the median difference is taken out")
    if loop is not None or any(models.values()):
        console.print(_model_table(facts["linear_model"], models, loop))
    if loop is not None:
        console.print(_effect_table(facts["effects"], loop))
        console.print(_error_table(loop))
    report = result / "report.html"
    if report.exists():
        console.print(f"report: {report}", soft_wrap=True)


def _clip_table(clips: list[ClipScore]) -> Table:
    table = Table("clip", "angle error RMS, deg", "frames ok", title="Angles against truth", title_justify="left")
    for clip in clips:
        rms = "none measured" if math.isnan(clip.rms_deg) else f"{clip.rms_deg:.4f}"
        note = "" if clip.offset_deg is None else f" (median {clip.offset_deg:+.3f} out)"
        table.add_row(clip.name, rms + note, f"{clip.ok}/{clip.frames}")
    return table


def _model_table(plant: dict[str, float], models: dict[str, Any], loop: dict[str, Any] | None) -> Table:
    """List a, b, c of every estimator; the loop's are those fitted together with the effects it found."""
    sources = {
        "EKF": (models["ekf"] or {}).get("parameters"),
        "output error": (models["model"] or {}).get("parameters"),
        "with effects": (loop or {}).get("model"),
    }
    columns = {title: parameters for title, parameters in sources.items() if parameters}
    table = Table("", "true", *columns, title="Model θ̈ = c·u − a·θ̇ − b·θ", title_justify="left")
    for symbol, unit in (("a", "per_s"), ("b", "per_s2"), ("c", "per_s2")):
        cells = [_against(parameters.get(f"{symbol}_{unit}"), plant[symbol]) for parameters in columns.values()]
        table.add_row(
            f"{symbol}, {unit.replace('per_s2', '1/s²').replace('per_s', '1/s')}", f"{plant[symbol]:g}", *cells
        )
    return table


def _effect_table(true: dict[str, dict[str, Any]], loop: dict[str, Any]) -> Table:
    found = {effect["id"]: effect["parameters"] for effect in loop.get("effects", [])}
    title = f"Effects: {loop.get('verdict', 'no verdict')}"
    table = Table("effect", "true, SI", "found, SI", title=title, title_justify="left")
    for name in [*true, *(name for name in found if name not in true)]:
        there = ", ".join(f"{key} {value:g}" for key, value in true.get(name, {}).items() if value is not None)
        here = ", ".join(_in_si(key, entry) for key, entry in found.get(name, {}).items())
        table.add_row(name, there or "not there", here or "not found")
    if not table.rows:
        table.add_row("none", "", "")
    return table


def _error_table(loop: dict[str, Any]) -> Table:
    rmse = loop.get("rmse_deg", {})
    before, after = rmse.get("before") or {}, rmse.get("after") or {}
    table = Table("RMSE, deg", "before", "after", title="Prediction", title_justify="left")
    for key, title in (("fit", "fitted recordings"), ("held_out", "held-out recordings")):
        table.add_row(title, _number(before.get(key)), _number(after.get(key)))
    table.add_row("noise floor", "", _number(rmse.get("noise_floor")))
    return table


def _against(entry: dict[str, Any] | None, true: float) -> str:
    if not entry or entry.get("value") is None:
        return "–"
    deviation = f" ({100 * (entry['value'] / true - 1):+.1f} %)" if true else ""
    sigma = "" if entry.get("sigma") is None else f" ± {entry['sigma']:.2g}"
    return f"{entry['value']:.2f}{sigma}{deviation}"


def _in_si(key: str, entry: dict[str, Any]) -> str:
    """Format a fitted parameter in SI, so that it is comparable with the spec's value."""
    factor = math.radians(1.0) if "_deg" in key else 1.0
    name = key.split("_deg")[0] if "_deg" in key else key
    value, sigma = entry.get("value"), entry.get("sigma")
    if value is None:
        return f"{name} –"
    return f"{name} {factor * value:.4g}" + ("" if sigma is None else f" ± {factor * sigma:.2g}")


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.4f}"


def _rows(path: Path) -> list[dict[str, str]]:
    try:
        with path.open(encoding="utf-8", newline="") as stream:
            return list(csv.DictReader(stream))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise SpecError(f"{path}: cannot be read ({error})") from error


def _json(path: Path) -> Any:
    if not path.exists():
        return None
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise SpecError(f"{path}: cannot be read ({error})") from error
