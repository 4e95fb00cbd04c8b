"""Tables for the terminal: measured series and step responses."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rich.table import Table

from anglecam.errors import printable
from anglecam.measurement.clip import Measurement
from anglecam.measurement.step_response import Figure, Response
from anglecam.measurement.tracks import MeasuredTracks


def series_table(measurements: Sequence[Measurement | MeasuredTracks]) -> Table:
    """Tabulate measured recordings: frames, range of angles, uncertainty, pivot and method."""
    table = Table("clip", "measured", "angle, °", "median sigma, °", "if 6 px off, °", "pivot", "by")
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


RESPONSE_HEADS = ("start, s", "from → to, °", "rise, s", "overshoot, %", "settled after, s", "peak, °/s")
"""Columns of a table of responses."""


def response_table(name: str, answers: Sequence[Response]) -> Table:
    """Tabulate the steps of a clip's angle from rest to rest."""
    table = Table(*RESPONSE_HEADS, title=printable(name), title_justify="left")
    for column in table.columns:
        column.justify = "right"
    for answer in answers:
        table.add_row(*response_cells(answer))
    return table


def response_cells(answer: Response) -> tuple[str, ...]:
    """Return a response as the cells of a row under `RESPONSE_HEADS`."""
    return (
        f"{answer.start.value:.3f}",
        f"{_plain(np.degrees(answer.from_angle.value))} → {_plain(np.degrees(answer.to_angle.value))}",
        _figure(answer.rise_time),
        _figure(answer.overshoot, 100.0),
        _figure(answer.settling_time),
        _figure(answer.peak_speed, 180.0 / np.pi),
    )


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
