"""What measuring leaves in a folder, for one clip at a time."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from anglecam.data.command import Command
from anglecam.io.files import write_json
from anglecam.io.series_csv import write_series
from anglecam.io.session import SERIES_ENDING
from anglecam.measurement.clip import Measurement
from anglecam.measurement.clock_sync import offset_of, on_clip_clock
from anglecam.measurement.step_response import Response, responses, responses_as_dicts
from anglecam.measurement.tracks import MeasuredTracks
from anglecam.report.figures import plot_series


def write_measurement(
    measurement: Measurement | MeasuredTracks, command: Command | None, out: Path
) -> tuple[Response, ...]:
    """Write ``NAME.angles.csv``, a plot and, where the angle goes from rest to rest, ``NAME.responses.json``.

    Parameters
    ----------
    measurement : Measurement or MeasuredTracks
        Of one clip.
    command : Command, optional
        What was commanded.
    out : Path
        Folder for the files.

    Returns
    -------
    tuple of Response
        How the angle answered every change.
    """
    series = measurement.series
    command = on_clip_clock(command, offset_of(command, series.evidence.lamp_s))
    write_series(series, out / f"{series.name}{SERIES_ENDING}")
    changes = [] if command is None else command.time[1:][np.diff(command.angle) != 0.0].tolist()
    answers = responses(series.time, series.angle, series.sigma, changes)
    if answers:
        write_json(out / f"{series.name}.responses.json", responses_as_dicts(answers))
    plot_series(series, out / f"{series.name}.png")
    return answers
