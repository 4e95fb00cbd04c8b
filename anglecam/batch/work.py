"""One clip's whole job, the same on this machine and on any other: look, fetch, have it measured, put it in place.

It runs in the batch's own process or in a Dask worker. What may crash or hang, decoding and measuring, runs in a
process of its own; here only whole files are moved.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import socket
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from anglecam import __version__
from anglecam.batch.address import PassingError, fetch, is_remote, join, name, names_in, parent, stem
from anglecam.batch.identity import calibration_named, clip_configuration, content_hash, is_settled, stamp
from anglecam.batch.lock import is_current
from anglecam.batch.process import Lost, MeasuringProcess
from anglecam.batch.records import Note, Store
from anglecam.batch.row import FAILED, OK, TRUNCATED, Row, cannot_write
from anglecam.errors import AnglecamError, InputError, RigError, blame, printable
from anglecam.io.command_csv import COMMAND_ENDING

_LEAST_TIME_S = 600.0
_TIME_PER_BYTE_S = 1e-5
"""Ten seconds a megabyte: a hundred times what a film of ordinary compression takes."""


@dataclass(frozen=True)
class Settings:
    """What holds for every job of one batch."""

    out: str
    """The output folder, absolute."""
    run: str
    """The run that has the lock."""
    rig: str | None = None
    """The rig file for all clips."""
    retry_failed: bool = False
    time_limit: float | None = None
    """Seconds a clip; ``None``: by its size."""
    version: str = __version__
    """Of whoever started the batch."""


@dataclass(frozen=True)
class ClipJob:
    """A clip to be measured."""

    address: str
    place: str
    keep: bool
    """Whether the series is wanted for a session."""


def do_clip(job: ClipJob, settings: Settings, process: MeasuringProcess) -> Note:
    """Measure a clip, unless that is done already; nothing is raised.

    Parameters
    ----------
    job : ClipJob
        The clip.
    settings : Settings
        What holds for all.
    process : MeasuringProcess
        What measures.

    Returns
    -------
    Note
        What became of it, with its results in place, or as an earlier call left it.
    """
    began = time.monotonic()
    store = Store(Path(settings.out))
    before = store.read_clip(job.address)
    note = Note(Row(printable(job.address), version=__version__), job.address, job.place)
    made: dict[str, Path] = {}
    with unfinished(store, settings.run) as work:
        try:
            with blame(Path(job.address)):
                require_same_batch(settings, store)
                note = _identified(note, settings)
                if before is not None and _is_done(before, note, job, settings, store):
                    return _renewed(before, note, settings, store)
                clip = _fetched(job.address, work) if is_remote(job.address) else Path(job.address)
                note = replace(note, row=replace(note.row, sha256=content_hash(clip)))
                if before is not None and _is_done(before, note, job, settings, store):
                    return _renewed(before, note, settings, store)
                note, made = _measured(note, job, settings, process, clip, work)
        except AnglecamError as problem:
            cause, passing = told(problem, job.address, work), isinstance(problem, PassingError)
            note = _failed(note, cause, call_is_wrong=isinstance(problem, RigError), passing=passing)
        note = replace(note, row=replace(note.row, wall_time_s=round(time.monotonic() - began, 3)))
        return _published(note, made, before, settings, store)


@contextlib.contextmanager
def unfinished(store: Store, run: str) -> Iterator[Path]:
    """Give a folder to make results in, and remove it."""
    work = store.unfinished(run) / os.urandom(8).hex()
    try:
        yield work
    finally:
        shutil.rmtree(work, ignore_errors=True)


def require_same_batch(settings: Settings, store: Store) -> None:
    """Refuse to work with another version than whoever started the batch, or for a folder that is not its folder."""
    if settings.version != __version__:
        raise RigError(f"this worker has anglecam {__version__}; the batch was started by {settings.version}")
    if not is_current(store.lock, settings.run):
        raise RigError(f"--out {store.out}: {socket.gethostname()} does not see the folder that the batch sees there")


def told(problem: Exception | str, address: str, work: Path) -> str:
    """Return a problem's text without what the reader knows, the clip, and without the name of a temporary folder."""
    text = str(problem).replace(str(_beside(work, address)), parent(address).rstrip("/"))
    return printable(text.removeprefix(f"{address}: "))


def fetch_beside(address: str, work: Path, wanted: frozenset[str]) -> Path:
    """Fetch files of a remote folder, and the calibration that its rig file names, to a folder of that name.

    Parameters
    ----------
    address : str
        A file of the folder.
    work : Path
        Where the folder is made.
    wanted : frozenset of str
        Names; those that are not there are left out.

    Returns
    -------
    Path
        The folder.
    """
    here = _beside(work, address)
    here.mkdir(parents=True, exist_ok=True)
    there = parent(address)
    for file in sorted(wanted & names_in(there)):
        fetch(join(there, file), here / file)
    rig = here / "rig.yaml"
    calibration = calibration_named(rig.read_bytes()) if rig.exists() else None
    if calibration is not None and (here / calibration).resolve().is_relative_to(here.resolve()):
        fetch(join(there, calibration), here / calibration)
    return here


def _beside(work: Path, address: str) -> Path:
    """Return the folder that stands for a remote file's own."""
    return work / "in" / (name(parent(address)) or "root")


def _identified(note: Note, settings: Settings) -> Note:
    """Say which clip this is and what is declared of it."""
    seen = stamp(note.address)
    row = replace(note.row, size_bytes=seen["size"], configuration=clip_configuration(note.address, settings.rig))
    return replace(note, row=row, stamp=seen, settled=is_settled(seen))


def _is_done(before: Note, note: Note, job: ClipJob, settings: Settings, store: Store) -> bool:
    """Tell whether an earlier call's results are what this one would give."""
    sha256 = note.row.sha256
    same = before.row.sha256 == sha256 if sha256 else before.settled and before.stamp == note.stamp
    return (
        same
        and before.row.sha256 is not None
        and (before.row.configuration, before.row.version) == (note.row.configuration, note.row.version)
        and before.place == job.place
        and not before.passing
        and not (before.row.status == FAILED and settings.retry_failed)
        and not (job.keep and before.row.status != FAILED and store.kept(job.address) not in before.files)
        and store.has(before.files)
    )


def _renewed(before: Note, note: Note, settings: Settings, store: Store) -> Note:
    """Keep what an earlier call found; a clip that was merely touched need not be read again."""
    renewed = replace(before, stamp=note.stamp, settled=note.settled, gone=False)
    if renewed != before:
        with contextlib.suppress(OSError):
            store.renew(renewed, settings.run)
    return replace(renewed, unchanged=True)


def _fetched(address: str, work: Path) -> Path:
    here = fetch_beside(address, work, frozenset({"rig.yaml", stem(address) + COMMAND_ENDING}))
    fetch(address, here / name(address))
    return here / name(address)


def _measured(
    note: Note, job: ClipJob, settings: Settings, process: MeasuringProcess, clip: Path, work: Path
) -> tuple[Note, dict[str, Path]]:
    """Have a clip measured; return what became of it and its finished files by their places."""
    into, kept = work / "out", work / "series.nc"
    try:
        into.mkdir(parents=True)
    except OSError as problem:
        return _failed(note, cannot_write(problem), passing=True), {}
    request = {
        "clip": str(clip),
        "rig": settings.rig,
        "into": str(into),
        "keep": str(kept) if job.keep else None,
    }
    try:
        answer = process.ask(request, settings.time_limit or time_allowed(note.row.size_bytes or 0))
    except Lost as loss:
        raise InputError(f"{job.address}: {loss}") from loss
    figures = {key: value for key, value in answer.items() if key in Row.__dataclass_fields__ and key != "cause"}
    note = replace(note, row=replace(note.row, **figures))
    if "cause" in answer:
        cause = told(answer["cause"], job.address, work)
        return _failed(note, cause, call_is_wrong=answer["call_is_wrong"], passing=answer["passing"]), {}
    if not is_remote(note.address) and stamp(note.address) != note.stamp:
        return _failed(note, "it changed while it was being measured", passing=True), {}
    made = {job.place + file.name[len(clip.stem) :]: file for file in sorted(into.iterdir())}
    if job.keep:
        made[Store(Path(settings.out)).kept(job.address)] = kept
    row = replace(
        note.row,
        status=TRUNCATED if answer["truncated"] else OK,
        cause=answer["truncated"],
        series=printable(f"{job.place}.angles.csv"),
    )
    return replace(note, row=row), made


def time_allowed(size_bytes: int) -> float:
    """Return a clip's time limit, s, where none is asked for: what no sound clip of its size needs."""
    return _LEAST_TIME_S + _TIME_PER_BYTE_S * size_bytes


def _failed(note: Note, cause: str, *, call_is_wrong: bool = False, passing: bool = False) -> Note:
    row = replace(note.row, status=FAILED, cause=cause, series=None)
    return replace(note, row=row, call_is_wrong=call_is_wrong, passing=passing)


def _published(note: Note, made: dict[str, Path], before: Note | None, settings: Settings, store: Store) -> Note:
    """Put results and note in place, if this run still has the folder."""
    if not is_current(store.lock, settings.run):
        return _failed(note, "the batch had ended before this was done", passing=True)
    stale = before.files if before is not None and before.place == note.place else {}
    try:
        published: Note = store.publish(note, made, stale, settings.run)
    except OSError as problem:
        return _failed(note, cannot_write(problem), passing=True)
    return published
