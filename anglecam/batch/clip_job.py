"""The job for one clip, the same on every worker: identify it, fetch it if it is remote, and have it measured."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path

from anglecam import __version__
from anglecam.batch.address import TransientError, fetch, is_remote, name, stem
from anglecam.batch.identity import clip_inputs, combined_hash, content_hash, is_reliable, stamp
from anglecam.batch.lock import is_current
from anglecam.batch.measuring_process import Measurer, ProcessLost
from anglecam.batch.publish import Finished, finish, not_done, workspace
from anglecam.batch.records import ClipRecord
from anglecam.batch.row import DOUBTFUL, OK, TRUNCATED, Row
from anglecam.batch.trouble import Trouble, TroubleError, not_written
from anglecam.batch.worker import Settings, clip_time_limit, fetch_beside, message_of, require_same_batch
from anglecam.errors import AnglecamError, InputError, RigError, blame, printable
from anglecam.io.clip_files import read_clip_files
from anglecam.io.command_csv import COMMAND_ENDING
from anglecam.io.rig import read_rig


@dataclass(frozen=True)
class ClipJob:
    """A clip to be measured."""

    address: str
    output_path: str
    """Path of its results relative to the output folder, without an ending."""
    in_session: bool
    """Whether its series is to be cached for the fit of a session."""
    before: ClipRecord | None = None
    """Its record by an earlier batch."""


def run_clip_job(job: ClipJob, settings: Settings, measurer: Measurer) -> Finished:
    """Measure a clip, unless an earlier batch has done so; raise nothing.

    Parameters
    ----------
    job : ClipJob
        The clip.
    settings : Settings
        The settings of the batch.
    measurer : Measurer
        What measures.

    Returns
    -------
    Finished
        The clip's record and its finished files, or the record of an earlier batch if nothing has changed.
    """
    began = time.monotonic()
    record = ClipRecord(job.address, Row(printable(job.address), version=__version__), job.output_path)
    made: dict[str, Path] = {}
    with workspace(settings.folder, settings.run) as work:
        try:
            with blame(Path(job.address)):
                require_same_batch(settings)
                record = _identified(record, settings)
                done = _done_before(record, job, settings)
                if done is not None:
                    return _unchanged(done, record)
                clip = _fetched(job.address, work) if is_remote(job.address) else Path(job.address)
                record = replace(record, row=replace(record.row, sha256=content_hash(clip)))
                done = _done_before(record, job, settings)
                if done is not None:
                    return _unchanged(done, record)
                record, made = _measured(record, job, settings, measurer, clip, work)
        except TroubleError as problem:
            return not_done(record, job.before, problem.trouble)
        except TransientError as problem:
            return not_done(record, job.before, Trouble(job.address, message_of(problem, job.address, work)))
        except AnglecamError as problem:
            cause = message_of(problem, job.address, work)
            record = record.failed(cause, call_is_wrong=isinstance(problem, RigError))
        record = replace(record, row=replace(record.row, wall_time_s=round(time.monotonic() - began, 3)))
        if not is_current(settings.folder, settings.run):
            return not_done(record, job.before, Trouble(job.address, "the batch had ended before it was finished"))
        return finish(record, made, job.before, work, settings.folder)


def _identified(record: ClipRecord, settings: Settings) -> ClipRecord:
    """Add which version of the clip this is, and the hash of what is declared for it."""
    found = stamp(record.address)
    inputs = clip_inputs(record.address, settings.rig)
    row = replace(record.row, size_bytes=found["size"], configuration=combined_hash(inputs))
    return replace(record, row=row, stamp=found, stamp_is_reliable=is_reliable(found), inputs=inputs)


def _done_before(record: ClipRecord, job: ClipJob, settings: Settings) -> ClipRecord | None:
    """Return the record whose results this batch would obtain again: of those in place, or of the last attempt."""
    earlier = () if job.before is None else (job.before.in_place, job.before)
    return next((one for one in earlier if one is not None and _is_done(one, record, job, settings)), None)


def _is_done(before: ClipRecord, record: ClipRecord, job: ClipJob, settings: Settings) -> bool:
    """Return whether this batch would obtain the results of an earlier one."""
    sha256 = record.row.sha256
    same_stamp = before.stamp_is_reliable and before.stamp == record.stamp
    same_content = before.row.sha256 == sha256 if sha256 else same_stamp  # without a hash the clip is not read yet
    return (
        same_content
        and before.row.sha256 is not None
        and (before.row.configuration, before.row.version) == (record.row.configuration, record.row.version)
        and before.output_path == job.output_path
        and not before.transient
        and not (before.has_failed and settings.retry_failed)
        and (not job.in_session or before.has_failed or settings.folder.cached_series(job.address) in before.files)
        and settings.folder.has(before.files)
    )


def _unchanged(before: ClipRecord, record: ClipRecord) -> Finished:
    """Keep the results of an earlier batch; with the new stamp, the next batch need not read the clip."""
    renewed = replace(before, stamp=record.stamp, stamp_is_reliable=record.stamp_is_reliable, removed=False)
    return Finished(renewed, unchanged=True, to_publish=renewed != before)


def _fetched(address: str, work: Path) -> Path:
    """Fetch a remote clip and the files beside it that its measurement depends on; return the local clip."""
    here = fetch_beside(address, work, frozenset({"rig.yaml", stem(address) + COMMAND_ENDING}))
    fetch(address, here / name(address))
    return here / name(address)


def _measured(
    record: ClipRecord, job: ClipJob, settings: Settings, measurer: Measurer, clip: Path, work: Path
) -> tuple[ClipRecord, dict[str, Path]]:
    """Have a clip measured; return its record, and its finished files by their output paths."""
    into, cached = work / "out", work / "series.nc"
    try:
        into.mkdir(parents=True)
    except OSError as problem:
        raise TroubleError(not_written(problem, job.address, settings.out)) from problem
    request = {
        "clip": str(clip),
        "rig": settings.rig,
        "into": str(into),
        "series_file": str(cached) if job.in_session else None,
    }
    try:  # before a process is started that measures
        read_clip_files(clip, None if settings.rig is None else read_rig(Path(settings.rig)))
    except RigError as problem:
        raise _unreadable(problem.one_line, job, work) from problem
    try:
        answer = measurer.ask(request, clip_time_limit(record.row.size_bytes or 0, settings))
    except ProcessLost as loss:
        raise InputError(f"{job.address}: {loss}") from loss
    figures = {name: value for name, value in answer.items() if name in Row.__dataclass_fields__ and name != "cause"}
    record = replace(record, row=replace(record.row, **figures))
    if not is_remote(record.address) and stamp(record.address) != record.stamp:
        return record.failed("it changed while it was being measured", transient=True), {}
    if "unreadable" in answer:
        raise _unreadable(answer["unreadable"], job, work)
    if "not_written" in answer:
        raise TroubleError(not_written(OSError(*answer["not_written"]), job.address, settings.out))
    if "cause" in answer:
        cause = message_of(answer["cause"], job.address, work)
        return record.failed(cause, call_is_wrong=answer["call_is_wrong"]), {}
    made = {job.output_path + file.name[len(clip.stem) :]: file for file in sorted(into.iterdir())}
    if job.in_session:
        made[settings.folder.cached_series(job.address)] = cached
    row = replace(
        record.row,
        status=TRUNCATED if answer["truncated"] else DOUBTFUL if answer["doubt"] else OK,
        cause=answer["doubt"],
        series=printable(f"{job.output_path}.angles.csv"),
    )
    return replace(record, row=row), made


def _unreadable(message: str, job: ClipJob, work: Path) -> TroubleError:
    """Return the trouble of a rig file, or its calibration, that cannot be read."""
    file, _, cause = message_of(message, job.address, work).partition(": ")
    return TroubleError(Trouble(file, cause, call_is_wrong=True))
