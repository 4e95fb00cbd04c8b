"""``report.html``: data, model, residual, candidates, verdict and next experiment, in one file without references."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from anglecam import __version__
from anglecam.data.series import AngleSeries
from anglecam.effects import effect
from anglecam.effects.unit_names import split_unit
from anglecam.identification.identified import Identified
from anglecam.io.files import write_atomically
from anglecam.io.session import CORRECTED, SERIES_ENDING
from anglecam.loop.next_experiment.design import Experiment
from anglecam.loop.refit import plant_of
from anglecam.loop.residual_test import StructureTest
from anglecam.loop.residual_torque import estimate_residual_torque
from anglecam.loop.stepwise import applicable
from anglecam.loop.verdict import Verdict
from anglecam.loop.verdict_json import NEXT_COMMAND, size_of
from anglecam.report import loop_figures as figures
from anglecam.report.free_form_figure import free_form_figure
from anglecam.report.path_figure import path_figure
from anglecam.report.wording import (
    free_form_sentence,
    free_run,
    noise_in_words,
    plain,
    remaining_structure,
    sentence,
    summary_of,
    with_uncertainty,
)

COLOURS = {
    "attributed": "#1f6f8b",
    "nothing_missing": "#3d7a4a",
    "unexplained": "#b5651d",
    "partly_explained": "#8a6d1d",
}
ESTIMATORS = {"ekf": "extended Kalman filter", "oe2": "output error"}
STATION_NOTES = {
    "command": "It acts on the command, before anything moves.",
    "actuator": "It acts between the command and the body, in servo and linkage.",
    "load": "It acts on the body.",
    "camera": "It is an effect of the camera, not of the mechanism: the body moves as the model predicts, but the film "
    "shows another angle or time.",
}
OPTIONAL_COLUMNS = {"sigma": "median σ, °", "bound": "6 px bound, °", "lever": "lever arm, px"}
"""Columns of the table of recordings that are shown only if they are not empty."""
SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
TESTS = {
    "residual against angle": "residual as a function of the angle",
    "residual against velocity": "residual as a function of the velocity",
    "residual against command": "residual as a function of recent commands",
    "residual against time": "slow drift of the residual over time",
    "torque against angle": "torque as a function of the angle",
    "torque against velocity": "torque as a function of the velocity",
    "autocorrelation": "autocorrelation of the residual",
}
"""Names of the tests that need no effect, in words."""


def write_report(
    path: Path,
    title: str,
    verdict: Verdict,
    result: dict[str, Any],
    experiment: Experiment | None,
    series: Sequence[AngleSeries],
    models: Sequence[Identified],
    problems: Sequence[str],
) -> None:
    """Write the report on a verdict.

    Parameters
    ----------
    path : Path
        The HTML file.
    title : str
        The session's name.
    verdict : Verdict
        From `anglecam.loop.close.close_records`.
    result : dict
        The content of ``loop.json``, from `anglecam.loop.verdict_json.verdict_as_dict`.
    experiment : Experiment or None
        The next recording, from `anglecam.loop.verdict_json.next_experiment`.
    series : sequence of AngleSeries
        The measured angles.
    models : sequence of Identified
        Base models to compare.
    problems : sequence of str
        Recordings that could not be used, with the cause.
    """
    # autoescape, because names of files and recordings come from the user; the SVG figures are marked as safe
    environment = Environment(loader=PackageLoader("anglecam.report", "."), autoescape=True, undefined=StrictUndefined)
    decimals = (
        4 if verdict.noise.sigma == 0.0 else int(np.clip(1 - np.floor(np.log10(np.degrees(verdict.noise.sigma))), 4, 6))
    )
    environment.filters |= {
        "p": lambda p: f"{p:.3f}" if p >= 1e-3 else "< 0.001",
        "in_words": p_in_words,
        "plain": plain,
        "deg": lambda value: f"{value:.{decimals}f}",
    }
    rows = [_series_row(s) for s in series]
    text = environment.get_template("page.html").render(
        title=title,
        version=__version__,
        colour=COLOURS[verdict.verdict],
        verdict=verdict,
        sentence=sentence(verdict),
        free_form="" if verdict.free_form is None else free_form_sentence(verdict.free_form),
        noise=noise_in_words(verdict),
        remains=remaining_structure(verdict),
        free_run=free_run(verdict),
        errors=result["rmse_deg"],
        gain=verdict.gain,
        policy=verdict.policy,
        validation=validation_in_words(verdict),
        series=rows,
        columns=[{"key": key, "head": head} for key, head in OPTIONAL_COLUMNS.items() if any(row[key] for row in rows)],
        problems=problems,
        models=[_model_row(m) for m in models],
        driven=any(r.command is not None for r in verdict.fitted),
        tests=_test_rows(verdict.first_test.tests),
        candidates=_candidate_rows(verdict, result),
        drawn=figures.MOST_RECORDINGS,
        effects=_effect_rows(verdict, result),
        final=_final_rows(verdict, result),
        corrected=CORRECTED
        if any((path.parent / CORRECTED / f"{s.name}{SERIES_ENDING}").exists() for s in series)
        else "",
        experiment=experiment,
        next_command=NEXT_COMMAND,
        detectable=_detectable_rows(result),
        undetectable=_undetectable(verdict),
        figures={name: environment.filters["safe"](svg) for name, svg in _figures(verdict, experiment, series).items()},
    )
    with write_atomically(path) as stream:
        stream.write(text)


def p_in_words(p: float) -> str:
    """Return a p-value as a number of sessions."""
    if p <= 1e-3:
        return "at most 1 of 1000"
    of = next((n for n in (10, 100) if round(n * p) >= 1), 1000)
    return "nearly all" if round(of * p) == of else f"{round(of * p)} of {of}"


def validation_in_words(verdict: Verdict) -> str:
    """Return on which frames the prediction error was computed, and by which models."""
    if verdict.held_out:
        held_out = ", ".join(r.name for r in verdict.held_out)
        return f"These recordings are declared as held out; they were predicted and never fitted: {held_out}."
    settings = verdict.policy.cross_validation
    return (
        f"No recording is declared as held out, so the error is that of block cross-validation: blocks of"
        f" {settings.left_out_s:g} s, one in every {settings.folds * settings.left_out_s:g} s, were predicted by a"
        f" model that was fitted to the other frames, {settings.folds} times in turn."
    )


def _figures(verdict: Verdict, experiment: Experiment | None, series: Sequence[AngleSeries]) -> dict[str, str]:
    """Draw the figures for a verdict, as SVG by name."""
    floor = verdict.noise.sigma
    commands = {r.name: r.command for r in [*verdict.fitted, *verdict.held_out] if r.command is not None}
    after = verdict.after_held_out if verdict.accepted else None
    drawn = {
        "measured": figures.measured_figure(series, commands),
        "prediction": figures.prediction_figure(verdict.fitted, verdict.before.residuals),
        "residual": figures.residual_figure(verdict.fitted, verdict.before, floor),
        "path": path_figure(verdict),
        "held_out": figures.held_out_figure(verdict.before_held_out, after),
        "errors": figures.error_figure(verdict.before_held_out, after, floor),
    }
    if verdict.candidates:
        drawn["candidates"] = figures.candidate_figure(verdict.candidates, [a.effect.id for a in verdict.accepted])
    if verdict.verdict in ("unexplained", "partly_explained"):
        drawn["residual_torque"] = figures.residual_torque_figure(
            estimate_residual_torque(verdict.after, verdict.fitted, verdict.noise)
        )
    if verdict.free_form is not None:
        drawn["free_form"] = free_form_figure(verdict.free_form)
    if experiment is not None and experiment.command is not None and experiment.separated:
        drawn["experiment"] = figures.experiment_figure(experiment, verdict)
    return drawn


def _series_row(series: AngleSeries) -> dict[str, Any]:
    ok = series.ok
    degrees = np.degrees(series.angle[ok])
    lever = None
    if series.mark_px is not None and series.pivot_px is not None:
        lever = float(np.median(np.hypot(*(series.mark_px - series.pivot_px)[ok].T)))
    bound = series.bounds.get(6.0)
    return {
        "name": series.name,
        "seconds": f"{series.time[-1] - series.time[0]:.1f}",
        "frames": len(ok),
        "measured": int(ok.sum()),
        "range": f"{degrees.min():.2f} … {degrees.max():.2f}".replace("-", "−"),
        "sigma": _text(
            np.degrees(np.nanmedian(series.sigma[ok])) if np.isfinite(series.sigma[ok]).any() else None, ".4f"
        ),
        "bound": _text(None if bound is None else np.degrees(np.nanmedian(bound[ok])), ".2f"),
        "lever": _text(lever, ".1f"),
    }


def _model_row(model: Identified) -> dict[str, Any]:
    cells = [with_uncertainty(v, s) for v, s in zip(model.values[:3], model.sigmas[:3], strict=True)]
    cells += [""] * (3 - len(cells))
    held_out = None if model.held_out is None else np.degrees(model.held_out.rmse)
    return {
        "name": ESTIMATORS[model.estimator],
        "cells": [*cells, f"{np.degrees(model.fit.rmse):.4f}", _text(held_out, ".4f")],
    }


def _test_rows(tests: Sequence[StructureTest]) -> dict[str, list[dict[str, Any]]]:
    """Divide the tests into those that need no effect and those for one effect, smallest p-value first."""
    rows: dict[str, list[dict[str, Any]]] = {"any": [], "effect": []}
    for test in sorted(tests, key=lambda t: t.p_value):
        of_effect = test.name.startswith("effect ")
        name = plain(test.name.removeprefix("effect ")) if of_effect else TESTS[test.name]
        rows["effect" if of_effect else "any"].append({"name": name, "p_value": test.p_value})
    return rows


def _candidate_rows(verdict: Verdict, result: dict[str, Any]) -> list[dict[str, Any]]:
    found = [a.effect.id for a in verdict.accepted]
    return [
        {
            "name": plain(c.effect.id),
            "found": c.effect.id in found,
            "station": c.effect.station,
            "gain": c.log_likelihood_gain,
            "predictive_gain": None if c.cross_validated is None else c.predictive_gain,
            "held_out": stated["held_out_rmse_deg"],
            "relaxes": c.effect.relaxes,
        }
        for c, stated in zip(verdict.candidates, result["candidates"], strict=True)
    ]


def _effect_rows(verdict: Verdict, result: dict[str, Any]) -> list[dict[str, Any]]:
    return [
        {
            "id": a.effect.id,
            "name": plain(a.effect.id),
            "summary": summary_of(a.effect, verdict.after),
            "equation": a.effect.equation,
            "fitted": [
                {
                    "symbol": parameter.symbol,
                    "name": split_unit(parameter.name)[0],
                    "value": with_uncertainty(stated["value"], stated["sigma"], _unit(parameter.name)),
                }
                for parameter, stated in zip(a.effect.parameters, shown["parameters"].values(), strict=True)
            ],
            "left_out": [p.symbol for p in effect(a.effect.id).parameters[len(a.effect.parameters) :]],
            "relaxes": a.effect.relaxes,
            "station_note": STATION_NOTES[a.effect.station],
            "rivals": [
                {"name": plain(name), "summary": summary_of(effect(name), rival), "station": effect(name).station}
                for name, rival in a.rivals.items()
            ],
            "aliases": [plain(name) for name in a.effect.aliases],
            "experiment": a.effect.separating_experiment,
        }
        for a, shown in zip(verdict.accepted, result["effects"], strict=True)
    ]


def _final_rows(verdict: Verdict, result: dict[str, Any]) -> list[dict[str, str]]:
    """List a, b and c of the final model."""
    count = plant_of(verdict.after).base_count
    return [
        {"name": split_unit(name)[0], "value": with_uncertainty(stated["value"], stated["sigma"], _unit(name))}
        for name, stated in list(result["model"].items())[:count]
    ]


def _detectable_rows(result: dict[str, Any]) -> list[dict[str, Any]]:
    return [
        {
            "name": plain(d["id"]),
            "what": split_unit(size_of(d["id"]).name)[0],
            "least": "at most" if size_of(d["id"]).inverse else "at least",
            "size": _number(d["smallest"]),
            "unit": _unit(size_of(d["id"]).name),
        }
        for d in sorted(result["detectable"], key=lambda d: d["id"])
    ]


def _undetectable(verdict: Verdict) -> list[str]:
    """Name the effects that the residual test would not have detected at any size that was tried."""
    detected = {*verdict.last_test.detectable, *(name for a in verdict.accepted for name in a.alias_set)}
    return [plain(e.id) for e in applicable([*verdict.fitted, *verdict.held_out]) if e.id not in detected]


def _unit(name: str) -> str:
    """Return a parameter's unit as it follows a number."""
    words = split_unit(name)[1].replace("deg", "°").replace("s2", "s²")
    return words if words == "°" else " " + words


def _number(value: float) -> str:
    """Return a number with three digits, and with a power of ten if it is very large or small."""
    mantissa, _, power = f"{float(f'{value:.3g}'):g}".partition("e")
    return mantissa + (f"·10{str(int(power)).translate(SUPERSCRIPT)}" if power else "")


def _text(value: float | None, form: str) -> str:
    return "" if value is None or np.isnan(value) else format(value, form)
