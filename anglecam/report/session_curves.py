"""What the page of a session draws of each recording: measured angle, models, residuals, and the frames of its film."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from anglecam.data.command import Command
from anglecam.data.record import Record
from anglecam.data.series import AngleSeries
from anglecam.data.typing import Floats
from anglecam.errors import printable
from anglecam.loop.verdict import Verdict
from anglecam.report.curves import Band, Columns, Curve, Plot, angle_plot, series_columns
from anglecam.report.figures import AFTER, BEFORE, FAINT, MEASURED
from anglecam.report.moments import choose_moments
from anglecam.report.pictures import Picture, most_pictures, take_pictures
from anglecam.video.film import Film

NOISE_SIGMAS = 2.0
"""Half width of the band of the noise in the plots of residuals, in standard deviations."""


@dataclass(frozen=True)
class Watched:
    """One recording on the page."""

    series: AngleSeries
    curves: Columns
    pictures: tuple[Picture, ...]

    @property
    def name(self) -> str:
        """The recording's name, as the page shows it."""
        return printable(self.series.name)


def watch(verdict: Verdict, series: Sequence[AngleSeries], films: Mapping[str, Film]) -> list[Watched]:
    """Gather the columns and the pictures of every recording.

    Parameters
    ----------
    verdict : Verdict
        From `anglecam.loop.close.close_records`.
    series : sequence of AngleSeries
        The recordings, with the angles that the loop starts from.
    films : mapping of str to Film
        Of those recordings that have one, by name.

    Returns
    -------
    list of Watched
        In the order of ``series``. A recording that the loop did not use has the measured angle alone.
    """
    commands = {r.name: r.command for r in [*verdict.fitted, *verdict.held_out] if r.command is not None}
    errors = _errors(verdict)
    found = []
    for one in series:
        command: Command | None = commands.get(one.name)
        columns = series_columns(one, None if command is None else command.at(one.time))
        columns |= {name: np.degrees(rows(one, *pairs)) for name, pairs in errors.get(one.name, {}).items()}
        for model, residual in (("before", "residual_before"), ("after", "residual_after")):
            if residual in columns:
                columns[f"model_{model}"] = columns["angle"] - columns[residual]
        changes = [] if command is None else command.time[1:][np.diff(command.angle) != 0.0].tolist()
        moments = choose_moments(one, columns.get("residual_before"), "residual", changes, most_pictures(len(series)))
        pictures = take_pictures(films.get(one.name), one, moments)
        found.append(Watched(one, Columns(one.name, one.first_frame, columns), pictures))
    return found


def session_plots(verdict: Verdict, watched: Sequence[Watched]) -> dict[str, Plot]:
    """Return the plots of the page by name."""
    columns = [one.curves for one in watched]
    sigma = float(np.degrees(verdict.noise.sigma))
    noise = (Band(f"noise, ±{NOISE_SIGMAS:g}σ", FAINT, NOISE_SIGMAS * sigma),)
    before, after = "before" if verdict.accepted else "base model", "after"
    models = [Curve("model_before", f"model {before}" if verdict.accepted else before, BEFORE)]
    residuals = [Curve("residual_before", f"residual {before}" if verdict.accepted else "residual", BEFORE)]
    errors = [Curve("error_before", f"error {before}" if verdict.accepted else "error", BEFORE)]
    plots = {}
    if verdict.accepted:
        models.append(Curve("model_after", f"model {after}", AFTER))
        residuals.append(Curve("residual_after", f"residual {after}", AFTER))
        errors.append(Curve("error_after", f"error {after}", AFTER))
        plots["error_after"] = Plot("error, °", (Curve("error_after", "error after", AFTER),), noise)
    dots = Curve("angle", "measured", MEASURED, "dots")
    return plots | {
        "angle": angle_plot(columns, models),
        "watched_residual": Plot("residual, °", tuple(residuals), noise),
        "prediction": Plot("angle, °", (dots, Curve("model_before", "base model", BEFORE))),
        "residual": Plot("residual, °", (Curve("residual_before", "measured − model", BEFORE),), noise),
        "error": Plot("error, °", tuple(errors), noise),
    }


def rows(series: AngleSeries, records: Sequence[Record], values: Sequence[Floats]) -> Floats:
    """Return values of records, which are parts of a series, at the rows of that series; NaN elsewhere."""
    found = np.full(len(series.time), np.nan)
    for record, part in zip(records, values, strict=True):
        at = np.minimum(np.searchsorted(series.time, record.time), len(series.time) - 1)
        same = series.time[at] == record.time
        found[at[same]] = part[same]
    return found


def _errors(verdict: Verdict) -> dict[str, dict[str, tuple[list[Record], list[Floats]]]]:
    """Return residuals and prediction errors, rad, by recording and column.

    The residual of a recording that was held out is its prediction error.
    """
    before, after = verdict.before_held_out, verdict.after_held_out
    sources = [("error_before", before.records, before.residuals)]
    sources += [("residual_before", verdict.fitted, verdict.before.residuals)]
    sources += [("residual_before", before.records, before.residuals)] if verdict.held_out else []
    if verdict.accepted:
        sources += [("error_after", after.records, after.residuals)]
        sources += [("residual_after", verdict.fitted, verdict.after.residuals)]
        sources += [("residual_after", after.records, after.residuals)] if verdict.held_out else []
    found: dict[str, dict[str, tuple[list[Record], list[Floats]]]] = {}
    for column, records, residuals in sources:
        for record, residual in zip(records, residuals, strict=True):
            parts = found.setdefault(record.name, {}).setdefault(column, ([], []))
            parts[0].append(record)
            parts[1].append(residual)
    return found
