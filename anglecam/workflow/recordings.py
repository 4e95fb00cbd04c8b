"""Recordings as angle series: clips and tracks measured, series read; what fails costs itself alone."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from anglecam.data.command import Command
from anglecam.data.record import Record, record_from_series
from anglecam.data.series import AngleSeries
from anglecam.errors import InputError, blame
from anglecam.io.rig import Rig
from anglecam.io.series_csv import read_series, write_series
from anglecam.io.session import SERIES_ENDING, Recording, Session
from anglecam.io.tracks.files import TRACKS_ENDINGS
from anglecam.measurement.clip import Measurement, measure_clip
from anglecam.measurement.clock_sync import note_on, offsets, on_clip_clock
from anglecam.measurement.tracks import MeasuredTracks, measure_tracks
from anglecam.measurement.uncorrected import uncorrected


@dataclass(frozen=True)
class Measured:
    """What a session gave."""

    series: tuple[AngleSeries, ...]
    records: tuple[Record, ...]
    """One for each of ``series`` that has enough measured frames."""
    problems: tuple[InputError, ...]
    """What could not be used, one line each."""
    notes: tuple[str, ...] = ()
    """What the user should know, such as which animal was followed in tracks, a line each."""


@dataclass(frozen=True)
class Shown:
    """A session as the loop is to see it: entry by entry the same recordings."""

    series: tuple[AngleSeries, ...]
    records: tuple[Record, ...]
    differs: bool
    """Whether the angles are those that the pictures show, because measuring has put something right."""


def shown_to_loop(session: Session, measured: Measured) -> Shown:
    """Return a session's angles as the pictures show them where the measurement has put something right.

    Parameters
    ----------
    session : Session
        What was measured.
    measured : Measured
        From `measure_session`.

    Returns
    -------
    Shown
        Of the recordings that can be used, so that the loop can name what the camera did; see `uncorrected`.
    """
    series, differs = uncorrected(measured.series)
    usable = {record.name for record in measured.records}
    kept = tuple(one for one in series if one.name in usable)
    if not differs:
        return Shown(kept, measured.records, differs)
    dated = {record.name: (record.command, record.clock_sigma) for record in measured.records}
    return Shown(kept, tuple(_record(one, *dated[one.name], session.rig) for one in kept), differs)


def _record(series: AngleSeries, command: Command | None, clock_sigma: float, rig: Rig) -> Record:
    declared = rig.model.gravity_deg
    upright = None if declared is None else math.radians(declared)
    record = record_from_series(series, command, zero_known=rig.neutral != "auto", mass_from_upright=upright)
    return replace(record, clock_sigma=clock_sigma)


def measure_recording(
    source: Path, rig: Rig, command: Command | None = None, *, progress: Callable[[int, int], None] | None = None
) -> Measurement | MeasuredTracks:
    """Measure a clip, or the tracks of points that another program has made from one.

    Parameters
    ----------
    source, rig, command, progress
        As of `measure_clip` and `measure_tracks`; tracks are read at once, without progress.

    Returns
    -------
    Measurement or MeasuredTracks
        Both have ``series``, ``angles``, ``pivot``, ``by``, ``notes``, ``truncated`` and ``contours_px``.

    Raises
    ------
    InputError, RigError
        As of both.
    """
    if source.name.endswith(SERIES_ENDING):
        raise InputError(f"{source}: holds angles already; identify or close the folder that it is in")
    if source.suffix.lower() in TRACKS_ENDINGS:
        return measure_tracks(source, rig, command)
    return measure_clip(source, rig, command, progress=progress)


def measure_session(
    session: Session,
    *,
    out: Path | None = None,
    progress: Callable[[str, int, int], None] = lambda name, done, total: None,
) -> Measured:
    """Measure every clip and all tracks of a session and read every series.

    Parameters
    ----------
    session : Session
        From `anglecam.io.session.read_session`.
    out : Path, optional
        Folder to write ``NAME.angles.csv`` of every measured recording to.
    progress : callable
        Told a clip's name, its frames done and (if known, else 0) in total.

    Returns
    -------
    Measured
        In the order of the recordings' names.
    """
    notes: list[str] = []

    def measured(recording: Recording) -> tuple[AngleSeries, str | None]:
        name = recording.name
        with blame(recording.source):
            measurement = measure_recording(
                recording.source,
                session.rig,
                recording.command,
                progress=lambda done, total: progress(name, done, total),
            )
        if out is not None:
            write_series(measurement.series, out / f"{name}{SERIES_ENDING}")
        if isinstance(measurement, MeasuredTracks):
            notes.extend(f"{recording.source}: {note}" for note in measurement.notes)
        return measurement.series, measurement.truncated

    gathered = gather_session(session, measured)
    return replace(gathered, notes=(*notes, *gathered.notes))


def gather_session(session: Session, series_of: Callable[[Recording], tuple[AngleSeries, str | None]]) -> Measured:
    """Read every series of a session and take those of its clips and tracks from ``series_of``.

    Parameters
    ----------
    session : Session
        From `anglecam.io.session.read_session`.
    series_of : callable
        From a recording to its series and, where its file ends too early, how much of it could be read.

    Returns
    -------
    Measured
        In the order of the recordings' names.
    """
    series, records, problems = [], [], list(session.problems)
    commands: dict[str, Command | None] = {}
    for recording in session.recordings:
        try:
            if recording.is_series:
                one = read_series(recording.source)
            else:
                one, truncated = series_of(recording)
                if truncated:
                    problems.append(InputError(f"{recording.source}: {truncated}"))
            series.append(one)
            commands[one.name] = recording.command
        except InputError as problem:
            problems.append(problem)
    ahead = offsets(commands, {one.name: one.evidence.lamp_s for one in series})
    for one in series:
        offset = ahead[one.name]
        try:
            records.append(_record(one, on_clip_clock(commands[one.name], offset), offset.sigma, session.rig))
        except InputError as problem:
            problems.append(problem)
    notes = [f"{one.name}: {said}" for one in series if (said := note_on(ahead[one.name]))]
    notes += [f"{r.name}: no command that changes; taken for a free swing" for r in records if r.command is None]
    return Measured(tuple(series), tuple(records), tuple(problems), tuple(notes))
