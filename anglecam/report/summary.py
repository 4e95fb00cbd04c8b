"""The tables in the terminal."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rich.table import Table

from anglecam.identify import Identified
from anglecam.loop.close import Verdict
from anglecam.loop.result import describe, sentence
from anglecam.measure import Measurement


def series_table(measurements: Sequence[Measurement]) -> Table:
    """Tabulate measured clips: frames, range, uncertainty, pivot."""
    table = Table("clip", "measured", "angle, °", "median sigma, °", "6 px bound, °", "pivot", "by")
    for column in table.columns[1:5]:
        column.justify = "right"
    for column in table.columns[:3]:
        column.no_wrap = True
    for measurement in measurements:
        series = measurement.series
        ok = series.ok
        degrees = np.degrees(series.angle[ok])
        table.add_row(
            series.name,
            f"{ok.sum()} of {len(ok)}",
            f"{degrees.min():.2f} … {degrees.max():.2f}",
            f"{np.degrees(np.median(series.sigma[ok])):.4f}",
            f"{np.degrees(np.median(series.bounds[6.0][ok])):.2f}",
            measurement.angles.pivot.source,
            "whole head" if measurement.why_coarse is None else f"mouth: {measurement.why_coarse}",
        )
    return table


def model_table(models: Sequence[Identified]) -> Table:
    """Tabulate models' parameters and errors."""
    table = Table("estimator", "parameters", "fit, ° RMS", "held out, ° RMS")
    for model in models:
        parameters = zip(model.names, model.values, model.sigmas, strict=True)
        table.add_row(
            model.estimator,
            "\n".join(f"{name} = {value:.5g} ± {sigma:.2g}" for name, value, sigma in parameters),
            f"{np.degrees(model.fit.rmse):.4f}",
            "" if model.held_out is None else f"{np.degrees(model.held_out.rmse):.4f}",
        )
    return table


def loop_table(verdict: Verdict) -> Table:
    """Tabulate a verdict."""
    table = Table("verdict", verdict.verdict.replace("_", " "), title=sentence(verdict), title_justify="left")
    for accepted in verdict.accepted:
        table.add_row(accepted.effect.id, describe(accepted.effect, verdict))
        if len(accepted.alias_set) > 1:
            table.add_row("not told apart from", ", ".join(accepted.alias_set[1:]))
    before, after = np.degrees(verdict.before_held_out.rmse), np.degrees(verdict.after_held_out.rmse)
    table.add_row("held-out error, ° RMS", f"{before:.4f} before, {after:.4f} after")
    table.add_row("noise floor, ° RMS", f"{np.degrees(verdict.noise.sigma):.4f} ({verdict.noise.source})")
    table.add_row("p of the base model's residual", f"{verdict.first_gate.p_value:.3f}")
    if verdict.verdict != "unexplained" and not verdict.last_gate.passed:
        table.add_row("what still shows", "less than half of the noise; not traced")
    return table
