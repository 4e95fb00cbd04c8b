"""``report.html``: the loop's story in the order of the work, one file that opens anywhere."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from anglecam import __version__
from anglecam.files import write_atomically
from anglecam.identify import Identified
from anglecam.loop.close import Verdict
from anglecam.loop.result import describe, sentence, verdict_as_dict
from anglecam.report import figures
from anglecam.series import AngleSeries

COLOURS = {"attributed": "#1f6f8b", "nothing_missing": "#3d7a4a", "unexplained": "#b5651d"}


def write_report(
    path: Path,
    title: str,
    verdict: Verdict,
    series: Sequence[AngleSeries],
    models: Sequence[Identified],
    problems: Sequence[Exception],
) -> None:
    """Write the report of one closed loop.

    Parameters
    ----------
    path : Path
        The HTML file.
    title : str
        The session's name.
    verdict : Verdict
        From `anglecam.loop.close.close_records`.
    series : sequence of AngleSeries
        What was measured.
    models : sequence of Identified
        Base models to show beside each other.
    problems : sequence of Exception
        What could not be used.
    """
    # autoescape: names of files and recordings are the user's, and SVG is marked safe where it is put in
    environment = Environment(loader=PackageLoader("anglecam.report", "."), autoescape=True, undefined=StrictUndefined)
    environment.filters["p"] = lambda value: f"{value:.3f}" if value >= 1e-3 else "< 0.001"
    result = verdict_as_dict(verdict)
    floor = verdict.noise.sigma
    held_out = {"before": verdict.before_held_out}
    if verdict.accepted:
        held_out["after"] = verdict.after_held_out
    drawings = {
        "prediction": figures.prediction_figure(verdict.fitted, verdict.before, "base model"),
        "residual": figures.residual_figure(verdict.fitted, {"before": verdict.before}, floor),
        "candidates": figures.candidate_figure(verdict),
        "held_out": figures.residual_figure(verdict.held_out, held_out, floor),
        "held_out_after": figures.residual_figure(verdict.held_out, {"after": verdict.after_held_out}, floor),
        "shape": figures.shape_figure(verdict),
    }
    text = environment.get_template("page.html").render(
        title=title,
        version=__version__,
        colour=COLOURS[verdict.verdict],
        verdict=verdict,
        sentence=sentence(verdict),
        stations=[a.effect.station for a in verdict.accepted],
        errors=result["rmse_deg"],
        gain=verdict.gain,
        phi=verdict.after.phi,
        held_out=[r.name for r in verdict.held_out],
        series=[_series_row(s) for s in series],
        problems=[str(p) for p in problems],
        models=[_model_row(m) for m in models],
        candidates=[
            {
                "id": c.effect.id,
                "gain": c.log_likelihood_gain,
                "held_out_gain": c.held_out_gain,
                "held_out": np.degrees(c.prediction.rmse),
                "relaxes": c.effect.relaxes,
            }
            for c in verdict.candidates
        ],
        found=[a.effect.id for a in verdict.accepted],
        effects=[
            {
                "id": a.effect.id,
                "summary": a.effect.summary,
                "equation": a.effect.equation,
                "fitted": describe(a.effect, verdict),
                "relaxes": a.effect.relaxes,
                "aliases": a.alias_set,
                "mistaken": a.effect.aliases,
                "experiment": a.effect.separating_experiment,
            }
            for a in verdict.accepted
        ],
        detectable=result["detectable"],
        figures={name: environment.filters["safe"](svg) for name, svg in drawings.items()},
    )
    with write_atomically(path) as stream:
        stream.write(text)


def _series_row(series: AngleSeries) -> dict[str, Any]:
    ok = series.ok
    degrees = np.degrees(series.angle[ok])
    lever = None
    if series.mouth_px is not None and series.pivot_px is not None:
        lever = float(np.median(np.hypot(*(series.mouth_px - series.pivot_px)[ok].T)))
    bound = series.bounds.get(6.0)
    return {
        "name": series.name,
        "frames": len(ok),
        "measured": int(ok.sum()),
        "range": f"{degrees.min():.2f} … {degrees.max():.2f}",
        "sigma": _text(
            np.degrees(np.nanmedian(series.sigma[ok])) if np.isfinite(series.sigma[ok]).any() else None, ".4f"
        ),
        "bound": _text(None if bound is None else np.degrees(np.nanmedian(bound[ok])), ".2f"),
        "lever": _text(lever, ".1f"),
    }


def _model_row(model: Identified) -> dict[str, Any]:
    cells = [f"{v:.5g} ± {s:.2g}" for v, s in zip(model.values[:3], model.sigmas[:3], strict=True)]
    cells += [""] * (3 - len(cells))
    held_out = None if model.held_out is None else np.degrees(model.held_out.rmse)
    names = {"ekf": "extended Kalman filter", "oe2": "output error"}
    return {"name": names[model.estimator], "cells": [*cells, _text(held_out, ".4f")]}


def _text(value: float | None, form: str) -> str:
    return "" if value is None or np.isnan(value) else format(value, form)
