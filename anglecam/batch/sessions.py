"""Folders in which a command stands beside a clip: each is one session, fitted when all its clips are measured."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from anglecam import __version__
from anglecam.batch.address import is_remote, join, name, names_in, parent, read_small, stem
from anglecam.batch.identity import combined, content_hash
from anglecam.batch.lock import is_current
from anglecam.batch.process import Lost, MeasuringProcess
from anglecam.batch.records import Note, SessionNote, Store
from anglecam.batch.row import FAILED, cannot_write
from anglecam.batch.sources import Source
from anglecam.batch.work import Settings, fetch_beside, require_same_batch, time_allowed, told, unfinished
from anglecam.errors import AnglecamError, InputError, RigError, blame, printable
from anglecam.io.command_csv import COMMAND_ENDING
from anglecam.io.session import CLIP_ENDINGS, SERIES_ENDING
from anglecam.io.tracks.files import find_tracks

_LEAST_TIME_S = 3600.0
"""For fitting, and for the bootstraps of the loop."""


@dataclass(frozen=True)
class SessionJob:
    """A session to be identified."""

    address: str
    """Its folder."""
    place: str
    """The folder for its results, relative to the output folder."""
    clips: tuple[str, ...]
    """Addresses of its clips."""
    close: bool
    """Whether to go the whole way."""


def find_sessions(sources: Sequence[Source]) -> list[tuple[str, str, tuple[str, ...]]]:
    """Find the folders that are sessions and of which every clip is asked for.

    Parameters
    ----------
    sources : sequence of Source
        The clips, in the order of their addresses.

    Returns
    -------
    list of (str, str, tuple of str)
        A folder, the folder that it was found under, and its clips' addresses, in the order of addresses.
    """
    folders: dict[str, list[Source]] = defaultdict(list)
    for source in sources:
        folders[parent(source.address)].append(source)
    sessions = []
    for folder, inside in sorted(folders.items()):
        names = names_in(folder)
        asked = {name(source.address) for source in inside}
        clips = {file for file in names if file.lower().endswith(CLIP_ENDINGS) and not file.startswith(".")}
        commanded = any(stem(file) + COMMAND_ENDING in names for file in asked)
        if commanded and clips <= asked:
            sessions.append((folder, inside[0].root, tuple(source.address for source in inside)))
    return sessions


def do_session(job: SessionJob, settings: Settings, process: MeasuringProcess) -> SessionNote:
    """Fit a session's model, unless that is done already; nothing is raised.

    Parameters
    ----------
    job : SessionJob
        The session; its clips are measured.
    settings : Settings
        What holds for all.
    process : MeasuringProcess
        What fits.

    Returns
    -------
    SessionNote
        What became of it, with its results in place, or as an earlier call left it.
    """
    began = time.monotonic()
    store = Store(Path(settings.out))
    clips = [store.read_clip(address) for address in job.clips]
    measured = [note for note in clips if note is not None and note.row.status != FAILED]
    before = store.read_session(job.address)
    note = SessionNote(job.address, "", job.place, version=__version__)
    made: dict[str, Path] = {}
    with unfinished(store, settings.run) as work:
        try:
            with blame(Path(job.address)):
                require_same_batch(settings, store)
                if not measured and not any(file.endswith(SERIES_ENDING) for file in names_in(job.address)):
                    return note  # what is wrong has been told of every clip
                note = replace(note, configuration=_configuration(job, settings, measured))
                # who went the whole way has the model too, and keeps what it found
                further = replace(note, configuration=_configuration(replace(job, close=True), settings, measured))
                if before is not None and any(_is_done(before, one, settings, store) for one in (note, further)):
                    return replace(before, unchanged=True)
                note, made = _fitted(note, job, settings, process, measured, work)
        except AnglecamError as problem:
            cause = told(problem, join(job.address, ""), work).removeprefix(f"{job.address}: ")
            note = replace(note, cause=cause, call_is_wrong=isinstance(problem, RigError))
        note = replace(note, wall_time_s=round(time.monotonic() - began, 3))
        if not is_current(store.lock, settings.run):
            return replace(
                note, model=None, verdict=None, effects=None, cause="the batch had ended before this was done"
            )
        stale = before.files if before is not None and before.place == note.place else {}
        try:
            published: SessionNote = store.publish(note, made, stale, settings.run)
        except OSError as problem:
            return replace(note, model=None, verdict=None, effects=None, cause=cannot_write(problem))
        return published


def _configuration(job: SessionJob, settings: Settings, measured: Sequence[Note]) -> str:
    """Return a hash of all that a session's results depend on."""
    files = sorted(f for f in names_in(job.address) if f.endswith((COMMAND_ENDING, SERIES_ENDING)))
    parts: dict[str, bytes | str | None] = {f"file {f}": read_small(join(job.address, f)) for f in files}
    parts |= {f"clip {note.address}": f"{note.row.sha256} {note.row.configuration}" for note in measured}
    if not is_remote(job.address):  # another program's tracks stand in a clip's place
        parts |= {f"tracks {path.name}": content_hash(path) for path in find_tracks(Path(job.address))}
    parts["rig"] = read_small(settings.rig or join(job.address, "rig.yaml"))
    parts["close"] = str(job.close)
    return combined(parts)


def _is_done(before: SessionNote, note: SessionNote, settings: Settings, store: Store) -> bool:
    same = (before.configuration, before.version, before.place) == (note.configuration, note.version, note.place)
    return same and not (before.cause and settings.retry_failed) and store.has(before.files)


def _fitted(
    note: SessionNote,
    job: SessionJob,
    settings: Settings,
    process: MeasuringProcess,
    measured: Sequence[Note],
    work: Path,
) -> tuple[SessionNote, dict[str, Path]]:
    """Have a session fitted; return what became of it and its finished files by their places."""
    store, into = Store(Path(settings.out)), work / "out"
    into.mkdir(parents=True)
    folder = _mirrored(job, work) if is_remote(job.address) else Path(job.address)
    request = {
        "session": str(folder),
        "rig": settings.rig,
        "into": str(into),
        "kept": {name(one.address): str(store.out / store.kept(one.address)) for one in measured},
        "close": job.close,
    }
    limit = max(_LEAST_TIME_S, sum(settings.time_limit or time_allowed(n.row.size_bytes or 0) for n in measured))
    try:
        answer = process.ask(request, limit)
    except Lost as loss:
        raise InputError(f"{job.address}: {loss}") from loss
    # what is wrong with a clip or its command is told of that clip
    known = tuple(str(folder / file) for clip in job.clips for file in (name(clip), _command(clip)))
    inside = join(job.address, "")
    problems = tuple(told(p, inside, work) for p in answer["problems"] if not p.startswith(known))
    note = replace(note, problems=problems)
    if "cause" in answer:
        cause = told(answer["cause"], inside, work).removeprefix(f"{job.address}: ")
        return replace(note, cause=cause, call_is_wrong=answer["call_is_wrong"]), {}
    before = f"{job.place}/" if job.place else ""
    made = {before + path.relative_to(into).as_posix(): path for path in sorted(into.rglob("*")) if path.is_file()}
    return replace(
        note, model=printable(f"{before}model.json"), verdict=answer["verdict"], effects=answer["effects"]
    ), made


def _command(clip: str) -> str:
    return stem(clip) + COMMAND_ENDING


def _mirrored(job: SessionJob, work: Path) -> Path:
    """Fetch a remote session, but of its clips the names alone: they are measured."""
    inside = join(job.address, "")
    small = frozenset(f for f in names_in(job.address) if f.endswith((COMMAND_ENDING, SERIES_ENDING)))
    folder = fetch_beside(inside, work, small | {"rig.yaml"})
    for clip in job.clips:
        (folder / name(clip)).touch()
    return folder
