"""One clip, or tracks of points in its place: open, measure, write the results.

The command line, the batch and the Python API all measure through these functions, so that every check is in one place.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from anglecam.data.command import Command
from anglecam.errors import InputError, blame
from anglecam.io.bodies_json import write_bodies
from anglecam.io.clip_files import ClipFiles, FrameRange, read_clip_files, recording_files
from anglecam.io.files import write_json
from anglecam.io.netcdf_parquet import Also, write_also
from anglecam.io.rig import Rig
from anglecam.io.series_csv import write_series
from anglecam.io.session import SERIES_ENDING, clip_beside, command_file_beside, rig_file_beside
from anglecam.io.tracks.files import TRACKS_ENDINGS
from anglecam.measurement.clip import Measurement, measure_clip
from anglecam.measurement.clock_sync import offset_of, on_clip_clock
from anglecam.measurement.step_response import Response, responses, responses_as_dicts
from anglecam.measurement.tracks import MeasuredTracks, measure_tracks
from anglecam.progress import Progress, unseen
from anglecam.report.origin import Run, origin_of
from anglecam.video.film import Film
from anglecam.video.open_film import open_film


@dataclass(frozen=True)
class Source:
    """What is measured, and what is declared about it."""

    path: Path
    """The clip, or the tracks in its place."""
    rig: Rig
    command: Command | None
    film: Film | None
    """The clip, opened; of tracks the clip that they were made from, ``None`` where it is not in the same folder."""

    @property
    def is_tracks(self) -> bool:
        """Whether another program has found the points already."""
        return self.path.suffix.lower() in TRACKS_ENDINGS


def open_source(path: Path, rig: Rig | None = None, frames: FrameRange = (None, None)) -> Source:
    """Open a clip or tracks, and read what is declared in the same folder.

    Parameters
    ----------
    path : Path
        A film, or a file of tracks.
    rig : Rig, optional
        In place of the ``rig.yaml`` in the folder of ``path``.
    frames : FrameRange
        In place of the rig's; ``None`` leaves the rig's.

    Returns
    -------
    Source
        Ready to be measured.

    Raises
    ------
    InputError
        Where the file cannot be read, its command file is wrong, or it holds angles already.
    RigError
        Where the rig file is wrong.
    """
    return open_files(read_clip_files(path, rig, frames))


def open_recording(path: Path, rig: Rig, command: Command | None) -> Source:
    """Open one recording of a session, whose rig and command have been read; raises as `open_source`."""
    return open_files(recording_files(path, rig, command))


def open_files(files: ClipFiles) -> Source:
    """Open the film of a clip whose other files have been read; raises as `open_source`."""
    with blame(files.path):
        film = None if files.film is None else open_film(files.film, files.rig.frames)
        return Source(files.path, files.rig, files.command, film)


def measure_source(
    source: Source, *, progress: Progress = unseen, every_body: bool = False
) -> Measurement | MeasuredTracks:
    """Measure the angle in every frame.

    Parameters
    ----------
    source : Source
        From `open_source` or `open_recording`.
    progress : Progress
        Called with each stage; tracks are measured without it.
    every_body : bool
        Whether all bodies that turn are measured; of tracks there is one.

    Returns
    -------
    Measurement or MeasuredTracks
        Both have ``series``, ``angles``, ``pivot``, ``by``, ``notes``, ``truncated`` and ``contours_px``.

    Raises
    ------
    InputError, RigError
        As `measure_clip` and `measure_tracks`. A fault of anglecam becomes an `InputError` that names the file.
    """
    with blame(source.path):
        if source.is_tracks or source.film is None:
            return measure_tracks(source.path, source.rig, source.command, film=source.film)
        return measure_clip(source.film, source.rig, source.command, progress=progress, every_body=every_body)


def write_measurement(
    measurement: Measurement | MeasuredTracks,
    command: Command | None,
    out: Path,
    also: Iterable[Also] = (),
) -> tuple[Response, ...]:
    """Write the results of a clip.

    ``NAME.angles.csv`` and a plot; where the angle moves from rest to rest, ``NAME.responses.json``; of a film
    ``NAME.bodies.json``, and ``NAME.b2.angles.csv`` and so on of the bodies that were measured besides the first.

    Parameters
    ----------
    measurement : Measurement or MeasuredTracks
        Of one clip.
    command : Command, optional
        What was commanded.
    out : Path
        Folder for the files.
    also : iterable of Also
        Further formats of the series.

    Returns
    -------
    tuple of Response
        The response to each change of the command.
    """
    from anglecam.report.figures import plot_series  # matplotlib takes a second to load

    series = measurement.series
    command = on_clip_clock(command, offset_of(command, series.evidence.lamp_s))
    write_series(series, out / f"{series.name}{SERIES_ENDING}")
    changes = [] if command is None else command.time[1:][np.diff(command.angle) != 0.0].tolist()
    noise = series.sigma if series.sigma_random is None else series.sigma_random
    answers = responses(series.time, series.angle, noise, changes)
    if answers:
        write_json(out / f"{series.name}.responses.json", responses_as_dicts(answers))
    plot_series(series, out / f"{series.name}.png")
    write_also(series, also, out / series.name)
    if isinstance(measurement, Measurement):
        write_bodies(measurement.bodies, out / f"{series.name}.bodies.json")
        for body in measurement.bodies[1:]:
            if body.series is not None:
                write_series(body.series, out / f"{body.series.name}{SERIES_ENDING}")
    return answers


def write_clip_page(
    source: Source,
    measurement: Measurement | MeasuredTracks,
    answers: Sequence[Response],
    out: Path,
    run: Run | None = None,
) -> None:
    """Write the page of a clip, ``NAME.html``.

    Parameters
    ----------
    source : Source
        The clip.
    measurement : Measurement or MeasuredTracks
        Of it.
    answers : sequence of Response
        From `write_measurement`.
    out : Path
        Folder for the page.
    run : Run, optional
        How the command was called.
    """
    from anglecam.report.clip_page import write_clip_html

    command = on_clip_clock(source.command, offset_of(source.command, measurement.series.evidence.lamp_s))
    made = origin_of(inputs_of(source.path, source.rig, run), run)
    write_clip_html(out, measurement, source.film, command, answers, made)


def inputs_of(path: Path, rig: Rig, run: Run | None = None) -> list[Path]:
    """Return the files that the measurement of a clip or of tracks depends on, whether they exist or not."""
    declared = run.rig if run is not None and run.rig is not None else rig_file_beside(path)
    calibration = rig.camera.calibration
    clip = clip_beside(path) if path.suffix.lower() in TRACKS_ENDINGS else None
    others = [command_file_beside(path), declared, None if calibration is None else Path(calibration), clip]
    return [path, *(one for one in others if one is not None)]


def write_clip_overlay(
    source: Source, measurement: Measurement | MeasuredTracks, out: Path, progress: Progress = unseen
) -> None:
    """Write ``NAME.overlay.mp4``.

    Raises
    ------
    InputError
        Where the clip of tracks is missing.
    """
    from anglecam.video.overlay import write_overlay

    if source.film is None:
        raise InputError(f"{source.path}: no overlay, because the clip is not in the folder of the tracks")
    write_overlay(source.film, measurement, out / f"{measurement.series.name}.overlay.mp4", progress)
