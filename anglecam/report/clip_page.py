"""``NAME.html``: the measured angle of one clip, with its film, in one file without references."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from anglecam.data.command import Command
from anglecam.data.series import AngleSeries
from anglecam.errors import printable
from anglecam.io.session import SERIES_ENDING
from anglecam.measurement.clip import Measurement
from anglecam.measurement.step_response import Response
from anglecam.measurement.tracks import MeasuredTracks
from anglecam.report.clip_tables import RESPONSE_HEADS, response_cells
from anglecam.report.curves import (
    DERIVATIVES,
    Columns,
    angle_plot,
    curves_as_dict,
    derivative_columns,
    derivative_plots,
    series_columns,
    sigma_plot,
)
from anglecam.report.document import html_of, write_html
from anglecam.report.figures import angle_panel, derivative_panel, sigma_panel
from anglecam.report.moments import choose_moments
from anglecam.report.origin import Origin
from anglecam.report.page_names import THUMBNAIL_ENDING, page_name
from anglecam.report.pictures import MOST_OF_RECORDING, take_pictures, thumbnail
from anglecam.video.film import Film

MEANINGS = {
    "ok": "the angle is measured",
    "no_mouth": "the mark was not found; in the paper the mark was a mouth",
    "occluded": "the mark is covered, or has another shape than in the other frames",
    "ambiguous": "several places could be the mark",
    "no_pivot": "the pivot was not found",
    "duplicate": "the frame repeats the one before",
    "undecodable": "the file is damaged here",
}
"""Of the values of ``status``."""
TITLES = {
    "angle": "Angle",
    "sigma": "Standard uncertainty",
    "velocity": "Velocity",
    "acceleration": "Acceleration",
}
"""Of the plots."""
THUMBNAIL_PX = 240


def write_clip_html(
    folder: Path,
    measurement: Measurement | MeasuredTracks,
    film: Film | None,
    command: Command | None,
    answers: Sequence[Response],
    made: Origin,
) -> None:
    """Write the page of a measured clip.

    Parameters
    ----------
    folder : Path
        Where the page is written, as `page_name` names it.
    measurement : Measurement or MeasuredTracks
        Of the clip.
    film : Film or None
        The clip; without it the page has no pictures.
    command : Command or None
        On the clip's clock.
    answers : sequence of Response
        To changes of the command.
    made : Origin
        How the result was made.
    """
    series, name = measurement.series, printable(measurement.series.name)
    changes = [] if command is None else command.time[1:][np.diff(command.angle) != 0.0].tolist()
    moments = choose_moments(series, series.sigma, "uncertainty", changes, MOST_OF_RECORDING)
    columns = series_columns(series, None if command is None else command.at(series.time))
    recording = Columns(series.name, series.first_frame, columns | derivative_columns(series))
    plots = {"angle": angle_plot([recording]), "sigma": sigma_plot(recording)}
    drawn = {"angle": angle_panel(series), "sigma": sigma_panel(series)}
    if series.derivatives is not None:
        plots |= derivative_plots()
        drawn |= {name: derivative_panel(series, name, unit) for name, unit in DERIVATIVES.items()}
    ok = series.ok
    ends = np.degrees([series.angle[ok].min(), series.angle[ok].max()])
    low, high = (f"{end:.2f}°".replace("-", "−") for end in ends)
    contents = {"film": "Angle and film", "steps": "From rest to rest", "frames": "Frames"}
    if not answers:
        del contents["steps"]
    text = html_of(
        "measure.html",
        contents=contents,
        made=made,
        curves=curves_as_dict([recording], plots),
        name=name,
        by=measurement.by,
        pivot=measurement.pivot,
        doubt=measurement.doubt,
        range=f"{low} … {high}",
        measured=int(ok.sum()),
        frames=len(ok),
        sigma=_median_sigma(measurement),
        common=common_part(series),
        bounded=bool(series.bounds),
        plots={name: TITLES[name] for name in plots},
        drawn=drawn,
        pictures=take_pictures(film, series, moments),
        answers=_response_table(answers),
        statuses=sorted(Counter(series.status).items(), key=lambda item: (item[0] != "ok", -item[1])),
        meanings=MEANINGS,
        notes=[printable(note) for note in measurement.notes],
        csv=printable(f"{series.name}{SERIES_ENDING}"),
    )
    write_html(folder / page_name(series.name), text)


def write_thumbnail(folder: Path, measurement: Measurement | MeasuredTracks, film: Film | None) -> None:
    """Write ``NAME.thumb.webp``, the first frame with an angle that can be decoded; nothing without a film."""
    if film is None:
        return
    measured = set(np.flatnonzero(measurement.series.ok).tolist())
    image = next((f.image for f in film.frames() if f.image is not None and f.index in measured), None)
    if image is not None:
        path = folder / f"{measurement.series.name}{THUMBNAIL_ENDING}"
        path.write_bytes(thumbnail(image, THUMBNAIL_PX))


def common_part(series: AngleSeries) -> str:
    """Return the common part of the uncertainty as a scale, such as ``2.1 %``; empty where it is not known."""
    share = series.common_share
    return f"{100.0 * share:.2g} %" if np.isfinite(share) else ""


def _median_sigma(measurement: Measurement | MeasuredTracks) -> str:
    sigma = np.degrees(measurement.series.sigma[measurement.series.ok])
    return f"{np.median(sigma):.2g}°" if np.isfinite(sigma).all() and len(sigma) else ""


def _response_table(answers: Sequence[Response]) -> dict[str, Any] | None:
    return {"heads": RESPONSE_HEADS, "rows": [response_cells(a) for a in answers]} if answers else None
