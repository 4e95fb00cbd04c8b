"""A session's recordings as angle series: clips measured, series read; what fails costs itself alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from anglecam.errors import InputError, blame
from anglecam.estimate.record import Record, record_from_series
from anglecam.measure import measure_clip
from anglecam.series import AngleSeries, read_series, write_series
from anglecam.session import SERIES_ENDING, Recording, Session
from anglecam.uncorrected import uncorrected


@dataclass(frozen=True)
class Measured:
    """What a session gave."""

    series: tuple[AngleSeries, ...]
    records: tuple[Record, ...]
    """One for each of ``series`` that has enough measured frames."""
    problems: tuple[InputError, ...]
    """What could not be used, one line each."""


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
    commands = {recording.name: recording.command for recording in session.recordings}
    known = session.rig.neutral != "auto"
    return Shown(kept, tuple(record_from_series(one, commands[one.name], zero_known=known) for one in kept), differs)


def measure_session(
    session: Session,
    *,
    out: Path | None = None,
    progress: Callable[[str, int, int], None] = lambda name, done, total: None,
) -> Measured:
    """Measure every clip of a session and read every series.

    Parameters
    ----------
    session : Session
        From `anglecam.session.read_session`.
    out : Path, optional
        Folder to write ``NAME.angles.csv`` of every measured clip to.
    progress : callable
        Told a clip's name, its frames done and (if known, else 0) in total.

    Returns
    -------
    Measured
        In the order of the recordings' names.
    """

    def measured(recording: Recording) -> tuple[AngleSeries, str | None]:
        name = recording.name
        with blame(recording.source):
            measurement = measure_clip(
                recording.source,
                session.rig,
                recording.command,
                progress=lambda done, total: progress(name, done, total),
            )
        if out is not None:
            write_series(measurement.series, out / f"{name}{SERIES_ENDING}")
        return measurement.series, measurement.sighting.truncated

    return gather_session(session, measured)


def gather_session(session: Session, series_of: Callable[[Recording], tuple[AngleSeries, str | None]]) -> Measured:
    """Read every series of a session and take those of its clips from ``series_of``.

    Parameters
    ----------
    session : Session
        From `anglecam.session.read_session`.
    series_of : callable
        From a clip's recording to its series and, where its file ends too early, how much of it could be read.

    Returns
    -------
    Measured
        In the order of the recordings' names.
    """
    series, records, problems = [], [], list(session.problems)
    zero_known = session.rig.neutral != "auto"
    for recording in session.recordings:
        try:
            if recording.is_clip:
                one, truncated = series_of(recording)
                if truncated:
                    problems.append(InputError(f"{recording.source}: {truncated}"))
            else:
                one = read_series(recording.source)
            series.append(one)
            records.append(record_from_series(one, recording.command, zero_known=zero_known))
        except InputError as problem:
            problems.append(problem)
    return Measured(tuple(series), tuple(records), tuple(problems))
