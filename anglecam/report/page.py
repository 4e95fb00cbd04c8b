"""``report.html``: data, model, residual, candidates, verdict and next experiment, in one file without references."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from anglecam.data.series import AngleSeries
from anglecam.errors import printable
from anglecam.identification.backbone import backbones
from anglecam.identification.identified import Identified
from anglecam.io.session import CORRECTED, SERIES_ENDING
from anglecam.loop.cross_validation import block_s
from anglecam.loop.next_experiment.design import Experiment
from anglecam.loop.residual_torque import estimate_residual_torque
from anglecam.loop.verdict import Verdict
from anglecam.loop.verdict_json import NEXT_COMMAND
from anglecam.report import loop_figures as figures
from anglecam.report import page_rows as rows
from anglecam.report.backbone_figure import backbone_figures
from anglecam.report.curves import curves_as_dict
from anglecam.report.document import html_of, write_html
from anglecam.report.free_form_figure import free_form_figures
from anglecam.report.origin import Origin
from anglecam.report.path_figure import effect_panels, signal_path
from anglecam.report.session_curves import Watched, session_plots, watch
from anglecam.report.wording import (
    free_run,
    missing_torque,
    noise_in_words,
    plain,
    remaining_structure,
    sentence,
)
from anglecam.video.film import Film

COLOURS = {
    "attributed": "#1f6f8b",
    "nothing_missing": "#2f6b3c",
    "unexplained": "#a04f0c",
    "partly_explained": "#7a5c00",
}
REMAINS = ("unexplained", "partly_explained")
"""Verdicts that leave structure."""


def write_report(
    path: Path,
    title: str,
    verdict: Verdict,
    result: dict[str, Any],
    experiment: Experiment | None,
    series: Sequence[AngleSeries],
    models: Sequence[Identified],
    problems: Sequence[object],
    *,
    shown: Sequence[AngleSeries] | None = None,
    films: Mapping[str, Film] | None = None,
    made: Origin | None = None,
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
    problems : sequence
        Recordings that could not be used, with the cause.
    shown : sequence of AngleSeries, optional
        The same recordings with the angles that the loop starts from, where measuring corrected a camera effect.
    films : mapping of str to Film, optional
        Of those recordings that have one, by name.
    made : Origin, optional
        How the report was made.
    """
    watched = watch(verdict, series if shown is None else shown, films or {})
    table = [rows.series_row(s) for s in series]
    text = html_of(
        "page.html",
        contents=_contents(verdict),
        made=made,
        curves=curves_as_dict([one.curves for one in watched], session_plots(verdict, watched)),
        filters={"p": _p, "in_words": p_in_words, "plain": plain, "deg": _degrees_filter(verdict)},
        title=printable(title),
        colour=COLOURS[verdict.verdict],
        verdict=verdict,
        sentence=sentence(verdict),
        free_form=missing_torque(verdict),
        noise=noise_in_words(verdict),
        remains=remaining_structure(verdict),
        free_run=free_run(verdict),
        errors=result["rmse_deg"],
        gain=verdict.gain,
        policy=verdict.policy,
        validation=validation_in_words(verdict),
        series=table,
        columns=[{"key": k, "head": head} for k, head in rows.OPTIONAL_COLUMNS.items() if any(r[k] for r in table)],
        watched=[_watched_row(one, verdict) for one in watched],
        bounded=any(one.series.bounds for one in watched),
        filmed=any(one.pictures for one in watched),
        uncorrected=shown is not None,
        problems=problems,
        models=[rows.model_row(m) for m in models],
        driven=any(r.command is not None for r in verdict.fitted),
        tests=rows.test_rows(verdict.first_test.tests),
        candidates=rows.candidate_rows(verdict, result),
        drawn=figures.MOST_RECORDINGS,
        effects=rows.effect_rows(verdict, result),
        final=rows.final_rows(verdict, result),
        corrected=CORRECTED
        if any((path.parent / CORRECTED / f"{s.name}{SERIES_ENDING}").exists() for s in series)
        else "",
        experiment=experiment,
        next_command=NEXT_COMMAND,
        detectable=rows.detectable_rows(result),
        undetectable=rows.undetectable(verdict),
        path=signal_path(verdict),
        figures=_figures(verdict, experiment, [one.series.name for one in watched]),
    )
    write_html(path, text)


def _contents(verdict: Verdict) -> dict[str, str]:
    """Return the headings by anchor."""
    last = {"torque": "The residual torque"} if verdict.verdict in REMAINS else {"detectable": "Detectable effects"}
    headings = {
        "measured": "Measured angles",
        "base": "The base model",
        "residual": "The residual test",
        "candidates": "The candidates",
        "verdict": "The verdict",
        "errors": "Prediction error before and after",
        "next": "Alternatives and the next recording",
        **last,
        "unused": "What could not be used or made",
    }
    return {anchor: f"{k} · {heading}" for k, (anchor, heading) in enumerate(headings.items(), 1)}


def _p(p: float) -> str:
    return f"{p:.3f}" if p >= 1e-3 else "< 0.001"


def _degrees_filter(verdict: Verdict) -> Any:
    """Return what formats degrees with as many digits as the noise leaves meaning."""
    sigma = np.degrees(verdict.noise.sigma)
    decimals = int(np.clip(1 - np.floor(np.log10(sigma)), 4, 6)) if sigma > 0.0 else 4
    return lambda value: f"{value:.{decimals}f}"


def _watched_row(one: Watched, verdict: Verdict) -> dict[str, Any]:
    """Return a recording with the plots that it has, and their drawings for print."""
    commands = {r.name: r.command for r in [*verdict.fitted, *verdict.held_out]}
    plots = {"angle": "Angle"}
    if "residual_before" in one.curves.columns:
        plots["watched_residual"] = "Residual"
    drawn = {"angle": figures.measured_panel(one.series, commands.get(one.series.name))}
    return {"name": one.name, "plots": plots, "drawn": drawn, "pictures": one.pictures}


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
    folds = verdict.policy.cross_validation.folds
    length = max(block_s(record, verdict.after.phi, verdict.policy) for record in verdict.fitted)
    return (
        f"No recording is declared as held out, so the error is that of block cross-validation: blocks of"
        f" {length:.2g} s, one in every {folds * length:.2g} s, were predicted by a model that was fitted to the other"
        f" frames, {folds} times in turn."
    )


def _figures(verdict: Verdict, experiment: Experiment | None, names: Sequence[str]) -> dict[str, Any]:
    """Draw the figures for a verdict: panels by name; ``names`` are those of the recordings, in the page's order."""
    floor = verdict.noise.sigma
    before, after = verdict.before_held_out, verdict.after_held_out if verdict.accepted else None
    drawn = {
        "prediction": figures.prediction_panels(verdict.fitted, verdict.before.residuals),
        "residual": figures.residual_panels(verdict.fitted, verdict.before, floor),
        "swings": [figures.Panel(svg) for svg in backbone_figures(backbones([*verdict.fitted, *verdict.held_out]))],
        "effects": [figures.Panel(svg, name) for name, svg in effect_panels(verdict)],
        "held_out": figures.held_out_panels(before, after),
        "errors": figures.error_panels(before, after, floor),
        "candidates": [],
        "residual_torque": [],
        "free_form": [],
        "experiment": [],
    }
    if verdict.candidates:
        found = [a.effect.id for a in verdict.accepted]
        drawn["candidates"] = [figures.Panel(figures.candidate_figure(verdict.candidates, found))]
    if verdict.verdict in REMAINS:
        torques = estimate_residual_torque(verdict.after, verdict.fitted, verdict.noise)
        drawn["residual_torque"] = figures.residual_torque_panels(torques)
    if verdict.free_form is not None:
        drawn["free_form"] = [figures.Panel(svg) for svg in free_form_figures(verdict.free_form)]
    if experiment is not None and experiment.command is not None and experiment.separated:
        drawn["experiment"] = figures.experiment_panels(experiment, verdict)
    return {name: [_panel_row(one, panels, names) for one in panels] for name, panels in drawn.items()}


def _panel_row(one: figures.Panel, panels: Sequence[figures.Panel], names: Sequence[str]) -> dict[str, Any]:
    """Return a panel with the number of its recording, if the scripts may draw the whole recording in its place."""
    same = [p for p in panels if p.record is not None and one.record is not None and p.record.name == one.record.name]
    whole = len({id(p.record) for p in same}) == 1
    number = names.index(one.record.name) if one.record is not None and one.plot and whole else None
    return {"svg": one.svg, "title": one.title, "plot": one.plot, "number": number}
