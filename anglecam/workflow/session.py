"""One session: measure its recordings, fit a model, close the loop.

The command line, the batch and the Python API all go through these functions, so that every check is in one place.
`anglecam.workflow.session_results` writes what they return.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from anglecam.data.camera_evidence import UNKNOWN_VIEW
from anglecam.data.command import Command
from anglecam.data.record import Record, record_from_series
from anglecam.data.series import AngleSeries
from anglecam.errors import InputError, RigError
from anglecam.io.rig import Rig
from anglecam.io.series_csv import read_series, write_series
from anglecam.io.session import SERIES_ENDING, Recording, Session, require_recordings
from anglecam.measurement.clip import Measurement
from anglecam.measurement.clock_sync import DARK, note_on, offsets, on_clip_clock
from anglecam.measurement.tracks import MeasuredTracks
from anglecam.measurement.trust import why_few
from anglecam.measurement.uncorrected import uncorrected
from anglecam.progress import Progress, unseen, within
from anglecam.workflow.clip import measure_source, open_recording

if TYPE_CHECKING:
    from anglecam.identification.identified import Identified
    from anglecam.loop.verdict import Verdict
    from anglecam.neck.large_angle import LargeAngleNeck


MOST_FRAMES = 200_000
"""Most frames of a session whose loop is closed. The residual test keeps 4 kB for each; with more, it takes hours."""


@dataclass(frozen=True)
class MeasuredSession:
    """A session whose recordings have been measured or read."""

    session: Session
    series: tuple[AngleSeries, ...]
    records: tuple[Record, ...]
    """One for each of ``series`` that has enough measured frames, as the rig's ``least_measured`` defines it."""
    problems: tuple[InputError, ...]
    """The causes why recordings cannot be used."""
    notes: tuple[str, ...] = ()
    """Messages to the user, a line each, such as what `measure` notes about a clip."""

    def split(self, hold_out: Sequence[str] = ()) -> tuple[list[Record], list[Record]]:
        """Return the records to fit and those to predict only.

        Parameters
        ----------
        hold_out : sequence of str
            Recordings to hold out besides those that the rig file names.

        Raises
        ------
        InputError
            Where no recording can be used.
        RigError
            Where a name in ``hold_out`` is no recording, or nothing is left to fit.
        """
        folder = self.session.directory
        if not self.records:
            raise InputError(f"{folder}: no recording can be used")
        require_recordings(self.session, hold_out)
        names = {*self.session.rig.held_out, *hold_out}
        fitted = [record for record in self.records if record.name not in names]
        if not fitted:
            raise RigError(f"{folder}: every recording that can be used is held out; nothing is left to fit")
        return fitted, [record for record in self.records if record.name in names]


@dataclass(frozen=True)
class LoopInput:
    """A session as the loop starts from it: for each recording the angle as the picture shows it."""

    series: tuple[AngleSeries, ...]
    records: tuple[Record, ...]
    """In the order of ``series``."""
    differs: bool
    """Whether these angles differ from the measured ones, because measuring corrected an effect of the camera."""


def measure_session(
    session: Session,
    *,
    out: Path | None = None,
    progress: Progress = unseen,
) -> MeasuredSession:
    """Measure all clips and tracks of a session and read all its series.

    Parameters
    ----------
    session : Session
        From `anglecam.io.session.read_session`.
    out : Path, optional
        Folder in which ``NAME.angles.csv`` of every measured recording is written.
    progress : Progress
        Called with each stage of each clip, and after each frame.

    Returns
    -------
    MeasuredSession
        In the order of the recordings' names.
    """
    notes: list[str] = []

    def measured(recording: Recording) -> tuple[AngleSeries, str | None]:
        name = recording.name
        source = open_recording(recording.source, session.rig, recording.command)
        measurement = measure_source(source, progress=within(progress, recording.source.name))
        if out is not None:
            write_series(measurement.series, out / f"{name}{SERIES_ENDING}")
        notes.extend(f"{recording.source}: {note}" for note in measurement.notes if note != _dated_alone(measurement))
        return measurement.series, measurement.truncated

    gathered = gather_session(session, measured)
    return replace(gathered, notes=(*notes, *gathered.notes))


def _dated_alone(measurement: Measurement | MeasuredTracks) -> str | None:
    """Return what a clip says about its clock by its own lamp; the lamps of all clips together say it better."""
    return measurement.clock if isinstance(measurement, Measurement) and measurement.clock != DARK else None


def gather_session(
    session: Session, series_of: Callable[[Recording], tuple[AngleSeries, str | None]]
) -> MeasuredSession:
    """Read all series of a session and take those of its clips and tracks from ``series_of``.

    Parameters
    ----------
    session : Session
        From `anglecam.io.session.read_session`.
    series_of : callable
        From a recording to its series and, where its file ends too early, how much of it could be read.

    Returns
    -------
    MeasuredSession
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
    notes = [f"{one.name}: {note}" for one in series if (note := note_on(ahead[one.name]))]
    notes += [f"{r.name}: no command that changes; treated as a free swing" for r in records if r.command is None]
    return MeasuredSession(session, tuple(series), tuple(records), tuple(problems), tuple(notes))


def loop_input(measured: MeasuredSession) -> LoopInput:
    """Return a session's angles as the pictures show them, where measuring corrected an effect of the camera.

    The loop then starts from the uncorrected angles and can attribute the effect; see `uncorrected`.

    Parameters
    ----------
    measured : MeasuredSession
        From `measure_session`.

    Returns
    -------
    LoopInput
        Of the recordings that can be used.
    """
    series, differs = uncorrected(measured.series)
    usable = {record.name for record in measured.records}
    kept = tuple(one for one in series if one.name in usable)
    if not differs:
        return LoopInput(kept, measured.records, differs)
    rig = measured.session.rig
    dated = {record.name: (record.command, record.clock_sigma) for record in measured.records}
    return LoopInput(kept, tuple(_record(one, *dated[one.name], rig) for one in kept), differs)


def identify_session(
    measured: MeasuredSession,
    estimator: str = "oe2",
    *,
    hold_out: Sequence[str] = (),
    neck: LargeAngleNeck | None = None,
) -> Identified:
    """Fit a model to the recordings of a session that are not held out.

    Parameters
    ----------
    measured : MeasuredSession
        From `measure_session`.
    estimator : str
        One of `anglecam.identification.estimators.ESTIMATORS`.
    hold_out : sequence of str
        Recordings to predict only, besides those that the rig file names.
    neck : LargeAngleNeck, optional
        What is known of the neck, for the estimator ``neck``; the paper's otherwise.

    Returns
    -------
    Identified
        The model, its uncertainty, its errors.

    Raises
    ------
    AnglecamError
        As `MeasuredSession.split`, and where the model cannot be fitted.
    """
    from anglecam.identification.identify_records import identify_records

    fitted, held_out = measured.split(hold_out)
    return identify_records(fitted, measured.session.rig, estimator, held_out=held_out, neck=neck)


def close_session(
    measured: MeasuredSession,
    *,
    hold_out: Sequence[str] = (),
    shown: LoopInput | None = None,
    progress: Progress = unseen,
) -> Verdict:
    """Find what the base model lacks in a session.

    Parameters
    ----------
    measured : MeasuredSession
        From `measure_session`.
    hold_out : sequence of str
        Recordings to predict only, besides those that the rig file names.
    shown : LoopInput, optional
        From `loop_input`, where the caller has it already.
    progress : Progress
        Called with each stage.

    Returns
    -------
    Verdict
        What was added, the evidence, the error before and after.

    Raises
    ------
    AnglecamError
        As `MeasuredSession.split`, where the session has more than `MOST_FRAMES`, and where no model can be fitted.
    """
    from anglecam.identification.identify_records import declared_start
    from anglecam.loop.close import close_records

    rig = measured.session.rig
    measured.split(hold_out)
    frames = sum(len(record.time) for record in measured.records)
    if frames > MOST_FRAMES:
        what = f"{frames:,} frames, and a loop can be closed over {MOST_FRAMES:,}"
        raise InputError(f"{measured.session.directory}: {what}; give fewer or shorter recordings, or a lower rate")
    records = (loop_input(measured) if shown is None else shown).records
    names = list(dict.fromkeys((*rig.held_out, *hold_out)))
    return close_records(records, held_out=names, starts=[declared_start(rig)], progress=progress)


def _record(series: AngleSeries, command: Command | None, clock_sigma: float, rig: Rig) -> Record:
    few = why_few(series.status, rig.least_measured)
    if few is not None:
        raise InputError(f"{series.name}: no model is fitted to it: {few}")
    declared = rig.model.gravity_deg
    upright = None if declared is None else math.radians(declared)
    record = record_from_series(series, command, zero_known=rig.neutral != "auto", mass_from_upright=upright)
    return replace(record, clock_sigma=clock_sigma, view=record.view if rig.source == "camera" else UNKNOWN_VIEW)
