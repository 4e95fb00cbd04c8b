"""The job for one session: a folder with a command beside a clip, fitted when all its clips have been measured."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from anglecam import __version__
from anglecam.batch.address import TransientError, is_remote, join, name, names_in, parent, read_small, stem
from anglecam.batch.identity import combined_hash, content_hash, hashes
from anglecam.batch.lock import is_current
from anglecam.batch.measuring_process import Measurer, ProcessLost
from anglecam.batch.publish import Finished, finish, not_done, workspace
from anglecam.batch.records import ClipRecord, SessionRecord
from anglecam.batch.sources import Source
from anglecam.batch.trouble import Trouble, TroubleError, not_written
from anglecam.batch.worker import Settings, clip_time_limit, fetch_beside, message_of, require_same_batch
from anglecam.errors import AnglecamError, InputError, RigError, blame, printable
from anglecam.io.command_csv import COMMAND_ENDING
from anglecam.io.session import CLIP_ENDINGS, SERIES_ENDING
from anglecam.io.tracks.files import find_tracks

_MIN_TIME_LIMIT_S = 3600.0
"""For the fit and the bootstraps of the loop, in s."""


@dataclass(frozen=True)
class SessionJob:
    """A session to be fitted."""

    address: str
    """Its folder."""
    output_path: str
    """Folder for the results, relative to the output folder."""
    clips: tuple[str, ...]
    """Addresses of its clips."""
    close: bool
    """Whether to close the loop, as `anglecam close` does."""
    measured: tuple[ClipRecord, ...] = ()
    """Records of those of its clips that could be measured."""
    stale: tuple[str, ...] = ()
    """Names of those of its clips whose results are stale."""
    before: SessionRecord | None = None
    """Its record by an earlier batch."""


def find_sessions(sources: Sequence[Source]) -> list[tuple[str, str, tuple[str, ...]]]:
    """Find the folders that are sessions and all of whose clips belong to the batch.

    Parameters
    ----------
    sources : sequence of Source
        The clips of the batch, in the order of their addresses.

    Returns
    -------
    list of (str, str, tuple of str)
        A folder, the folder that was searched to find it, and its clips' addresses, in the order of addresses.
    """
    folders: dict[str, list[Source]] = defaultdict(list)
    for source in sources:
        folders[parent(source.address)].append(source)
    sessions = []
    for folder, inside in sorted(folders.items()):
        names = names_in(folder)
        in_batch = {name(source.address) for source in inside}
        clips = {file for file in names if file.lower().endswith(CLIP_ENDINGS) and not file.startswith(".")}
        has_command = any(stem(file) + COMMAND_ENDING in names for file in in_batch)
        if has_command and clips <= in_batch:
            sessions.append((folder, inside[0].root, tuple(source.address for source in inside)))
    return sessions


def run_session_job(job: SessionJob, settings: Settings, measurer: Measurer) -> Finished:
    """Fit a session's model, unless an earlier batch has done so; raise nothing.

    Parameters
    ----------
    job : SessionJob
        The session, with the records of its clips.
    settings : Settings
        The settings of the batch.
    measurer : Measurer
        What fits.

    Returns
    -------
    Finished
        The session's record and its finished files, or the record of an earlier batch if nothing has changed.
    """
    began = time.monotonic()
    record = SessionRecord(job.address, "", job.output_path, version=__version__)
    made: dict[str, Path] = {}
    with workspace(settings.folder, settings.run) as work:
        try:
            with blame(Path(job.address)):
                require_same_batch(settings)
                earlier = None if job.before is None else job.before.in_place
                if earlier is None and not job.measured and not _has_series(job.address):
                    return Finished(record, to_publish=False)  # each clip's failure has been reported
                inputs = _inputs(job, settings)
                record = replace(record, configuration=combined_hash(inputs), inputs=inputs)
                for before in (earlier, job.before):
                    if before is not None and _is_done(before, record, settings):
                        return Finished(before, unchanged=True, to_publish=before != job.before)
                if earlier is not None and job.stale:
                    raise InputError(f"{job.address}: not fitted again without {', '.join(job.stale)}")
                record, made = _fitted(record, job, settings, measurer, work)
        except TroubleError as problem:
            return not_done(record, job.before, problem.trouble)
        except TransientError as problem:
            cause = message_of(problem, join(job.address, ""), work)
            return not_done(record, job.before, Trouble(job.address, cause))
        except AnglecamError as problem:
            cause = message_of(problem, join(job.address, ""), work).removeprefix(f"{job.address}: ")
            record = record.failed(cause, call_is_wrong=isinstance(problem, RigError))
        record = replace(record, wall_time_s=round(time.monotonic() - began, 3))
        if not is_current(settings.folder, settings.run):
            return not_done(record, job.before, Trouble(job.address, "the batch had ended before it was finished"))
        return finish(record, made, job.before, work, settings.folder)


def _has_series(folder: str) -> bool:
    return any(file.endswith(SERIES_ENDING) for file in names_in(folder))


def _inputs(job: SessionJob, settings: Settings) -> dict[str, str | None]:
    """Return hashes of everything that a session's results depend on."""
    files = sorted(f for f in names_in(job.address) if f.endswith((COMMAND_ENDING, SERIES_ENDING)))
    parts: dict[str, bytes | str | None] = {f: read_small(join(job.address, f)) for f in files}
    parts |= {name(clip.address): f"{clip.row.sha256} {clip.row.configuration}" for clip in job.measured}
    if not is_remote(job.address):  # tracks by another program may stand in a clip's place
        parts |= {path.name: content_hash(path) for path in find_tracks(Path(job.address))}
    parts["rig"] = read_small(settings.rig or join(job.address, "rig.yaml"))
    return hashes(parts) | {"close": str(job.close)}


def _is_done(before: SessionRecord, record: SessionRecord, settings: Settings) -> bool:
    """Return whether this batch would obtain the results of an earlier one."""
    same = (before.configuration, before.version, before.output_path) == (
        record.configuration,
        record.version,
        record.output_path,
    )
    return same and not (before.has_failed and settings.retry_failed) and settings.folder.has(before.files)


def _fitted(
    record: SessionRecord, job: SessionJob, settings: Settings, measurer: Measurer, work: Path
) -> tuple[SessionRecord, dict[str, Path]]:
    """Have a session fitted; return its record, and its finished files by their output paths."""
    out, into = settings.folder, work / "out"
    try:
        into.mkdir(parents=True)
    except OSError as problem:
        raise TroubleError(not_written(problem, job.address, settings.out)) from problem
    folder = _fetched(job, work) if is_remote(job.address) else Path(job.address)
    request = {
        "session": str(folder),
        "rig": settings.rig,
        "into": str(into),
        "series_files": {name(clip.address): str(out.path / out.cached_series(clip.address)) for clip in job.measured},
        "close": job.close,
    }
    limit = sum(clip_time_limit(clip.row.size_bytes or 0, settings) for clip in job.measured)
    try:
        answer = measurer.ask(request, max(_MIN_TIME_LIMIT_S, limit))
    except ProcessLost as loss:
        raise InputError(f"{job.address}: {loss}") from loss
    if "not_written" in answer:
        raise TroubleError(not_written(OSError(*answer["not_written"]), job.address, settings.out))
    # problems with a clip or its command have been reported for that clip
    known = tuple(str(folder / file) for clip in job.clips for file in (name(clip), stem(clip) + COMMAND_ENDING))
    inside = join(job.address, "")
    problems = tuple(message_of(p, inside, work) for p in answer["problems"] if not p.startswith(known))
    record = replace(record, problems=problems)
    if "cause" in answer:
        cause = message_of(answer["cause"], inside, work).removeprefix(f"{job.address}: ")
        return record.failed(cause, call_is_wrong=answer["call_is_wrong"]), {}
    prefix = f"{job.output_path}/" if job.output_path else ""
    made = {prefix + path.relative_to(into).as_posix(): path for path in sorted(into.rglob("*")) if path.is_file()}
    model, verdict, effects = printable(f"{prefix}model.json"), answer["verdict"], answer["effects"]
    return replace(record, model=model, verdict=verdict, effects=effects), made


def _fetched(job: SessionJob, work: Path) -> Path:
    """Fetch a remote session except its clips, which have been measured: of them, make empty files of their names."""
    inside = join(job.address, "")
    small = frozenset(f for f in names_in(job.address) if f.endswith((COMMAND_ENDING, SERIES_ENDING)))
    folder = fetch_beside(inside, work, small | {"rig.yaml"})
    for clip in job.clips:
        (folder / name(clip)).touch()
    return folder
