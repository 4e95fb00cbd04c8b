"""Tables for the terminal: measured series, step figures, models and verdicts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rich.table import Table

from anglecam.errors import printable
from anglecam.identification.identified import Identified
from anglecam.loop.next_experiment.design import Experiment
from anglecam.loop.verdict import Verdict
from anglecam.loop.verdict_json import NEXT_COMMAND
from anglecam.measurement.clip import Measurement
from anglecam.measurement.step_response import Figure, Response
from anglecam.measurement.tracks import MeasuredTracks
from anglecam.report.wording import describe, sentence


def series_table(measurements: Sequence[Measurement | MeasuredTracks]) -> Table:
    """Tabulate measured recordings: frames, range of angles, uncertainty, pivot and method."""
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
            printable(series.name),
            f"{ok.sum()} of {len(ok)}",
            f"{_plain(degrees.min())} … {_plain(degrees.max())}",
            f"{np.degrees(np.median(series.sigma[ok])):.4f}",
            f"{np.degrees(np.median(series.bounds[6.0][ok])):.2f}",
            measurement.pivot,
            measurement.by,
        )
    return table


def response_table(name: str, answers: Sequence[Response]) -> Table:
    """Tabulate the steps of a clip's angle from rest to rest."""
    table = Table(
        "start, s", "from → to, °", "rise, s", "overshoot, %", "settled after, s", "peak, °/s", title=printable(name),
        title_justify="left",
    )  # fmt: skip
    for column in table.columns:
        column.justify = "right"
    for a in answers:
        table.add_row(
            f"{a.start.value:.3f}",
            f"{_plain(np.degrees(a.from_angle.value))} → {_plain(np.degrees(a.to_angle.value))}",
            _figure(a.rise_time),
            _figure(a.overshoot, 100.0),
            _figure(a.settling_time),
            _figure(a.peak_speed, 180.0 / np.pi),
        )
    return table


def _plain(degrees: float) -> str:
    """Format an angle in degrees; an angle that rounds to zero has no sign."""
    return f"{round(float(degrees), 2) + 0.0:.2f}"


def _figure(figure: Figure, factor: float = 1.0) -> str:
    """Format a figure to the second digit of its uncertainty."""
    value, sigma = factor * figure.value, factor * figure.sigma
    if not np.isfinite(value):
        return "–"
    digits = 3 if not 0.0 < sigma < np.inf else int(np.clip(1 - np.floor(np.log10(sigma)), 0, 5))
    return f"{value:.{digits}f} ± {sigma:.{digits}f}"


def model_table(models: Sequence[Identified]) -> Table:
    """Tabulate parameters and errors of models."""
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


def loop_table(verdict: Verdict, experiment: Experiment | None = None) -> Table:
    """Tabulate a verdict, its errors and the next recording."""
    table = Table("verdict", verdict.verdict.replace("_", " "), title=sentence(verdict), title_justify="left")
    for accepted in verdict.accepted:
        table.add_row(accepted.effect.id, describe(accepted.effect, verdict))
        if len(accepted.alias_set) > 1:
            table.add_row("cannot be distinguished from", ", ".join(accepted.alias_set[1:]))
    if experiment is not None and experiment.separated:
        file = "" if experiment.command is None else f": {NEXT_COMMAND}"
        table.add_row("record this next", f"{experiment.description}, {experiment.duration:g} s{file}")
    before, after = np.degrees(verdict.before_held_out.rmse), np.degrees(verdict.after_held_out.rmse)
    table.add_row("prediction error, ° RMS", f"{before:.4f} before, {after:.4f} after")
    table.add_row("noise floor, ° RMS", f"{np.degrees(verdict.noise.sigma):.4f} ({verdict.noise.source})")
    table.add_row("p-value of the base model's residual", f"{verdict.first_test.p_value:.3f}")
    if verdict.verdict != "unexplained" and not verdict.last_test.passed:
        table.add_row("remaining structure", "too small to be investigated further")
    return table
