"""From a finished job to results in place and a job record.

A worker, on this machine or another, makes a job's results in a workspace inside the output folder and ends with
`finish`. The batch's own process then calls `publish`, which moves the results to their output paths and saves the
record. Publishing in one process means that the database has a single writer. The order of its steps ensures that a
record only ever describes results that are in place:

1. delete the old record;
2. move the new results to their paths, and remove old results that have no successor;
3. save the new record.

An attempt that must not replace the earlier results (see `anglecam.batch.records.keeping`) moves and removes nothing:
its record is saved beside them. If results cannot be moved, the old record is saved again; files of new names are moved
first, so that a full disk shows before a file is replaced.

The worker also leaves its record in the workspace, as ``result.json``. If the batch is killed before or during
publication, the next batch completes it with `recover`, and the clip need not be measured again.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

from anglecam.batch.database import RecordDatabase
from anglecam.batch.output_folder import OutputFolder
from anglecam.batch.records import ClipRecord, Record, SessionRecord, keeping, record_from_dict
from anglecam.batch.trouble import Trouble, not_written

_RESULT = "result.json"


@dataclass(frozen=True)
class Finished:
    """What a worker returns for a job."""

    record: Record
    trouble: Trouble | None = None
    """Why the job was not done, if the reason lies not in its clip."""
    unchanged: bool = False
    """Whether the results are those of an earlier batch, already in place."""
    to_publish: bool = True
    """Whether the record is to be saved, and files to be moved."""
    made: dict[str, str] = field(default_factory=dict)
    """From output path to the finished file, both relative to the output folder."""
    superseded: tuple[str, ...] = ()
    """Results of the same clip or session by an earlier batch, relative to the output folder."""
    workspace: str = ""
    """Folder of the finished files relative to the output folder, if the job left one."""


@contextmanager
def workspace(folder: OutputFolder, run: str) -> Iterator[Path]:
    """Give a path for a job's workspace, and remove the workspace unless `finish` has left a result there."""
    path = folder.unfinished(run) / os.urandom(8).hex()
    try:
        yield path
    finally:
        if not (path / _RESULT).exists():
            shutil.rmtree(path, ignore_errors=True)


def finish(record: Record, made: dict[str, Path], before: Record | None, path: Path, folder: OutputFolder) -> Finished:
    """Complete a job in its workspace, ready to be published.

    Parameters
    ----------
    record : ClipRecord or SessionRecord
        The outcome, without ``files``.
    made : dict
        From output path to the finished file in the workspace.
    before : ClipRecord or SessionRecord, optional
        The record of the same clip or session by an earlier batch.
    path : Path
        The workspace.
    folder : OutputFolder
        The output folder.

    Returns
    -------
    Finished
        With trouble if the results cannot be written.
    """
    record = keeping(record, before)
    if record.has_failed:
        made = {}
    # after a change of output path the old results stay where they are
    earlier = None if before is None else before.in_place
    is_replaced = not record.has_failed and earlier is not None and earlier.output_path == record.output_path
    superseded = tuple(earlier.files) if is_replaced and earlier is not None else ()
    inside = {output: str(file.relative_to(folder.path)) for output, file in made.items()}
    try:
        path.mkdir(parents=True, exist_ok=True)
        for file in made.values():  # the record will survive a power failure, so the results must, too
            _synchronise(file)
        record = replace(record, files={output: file.stat().st_size for output, file in made.items()})
        content = {"record": asdict(record), "made": inside, "superseded": superseded}
        unnamed = path / f"{_RESULT}.unfinished"
        unnamed.write_text(json.dumps(content))
        unnamed.replace(path / _RESULT)
    except OSError as problem:
        return not_done(record, before, not_written(problem, record.address, str(folder.path)))
    return Finished(record, made=inside, superseded=superseded, workspace=str(path.relative_to(folder.path)))


def not_done(record: Record, before: Record | None, trouble: Trouble) -> Finished:
    """Return the outcome of a job that the batch could not do: the record of an earlier batch, and nothing to publish.

    Parameters
    ----------
    record : ClipRecord or SessionRecord
        What is known of the clip or session.
    before : ClipRecord or SessionRecord, optional
        Its record by an earlier batch. If there are no results, the index states the trouble as the cause.
    trouble : Trouble
        Why the job was not done.
    """
    if before is not None and before.in_place is not None:
        return Finished(before, trouble, to_publish=False)
    cause = trouble.cause if trouble.where == record.address else f"{trouble.where}: {trouble.cause}"
    return Finished(record.failed(cause, call_is_wrong=trouble.call_is_wrong), trouble, to_publish=False)


def publish(finished: Finished, folder: OutputFolder, database: RecordDatabase) -> Finished:
    """Put the results of a job in place and save its record; raise nothing.

    Parameters
    ----------
    finished : Finished
        From a worker.
    folder : OutputFolder
        The output folder.
    database : RecordDatabase
        Its job records.

    Returns
    -------
    Finished
        The same, or with trouble if results or record cannot be written.
    """
    record = finished.record
    if not finished.to_publish:
        return finished
    if finished.unchanged:  # such as a clip with a new stamp and the same content
        with contextlib.suppress(OSError):
            database.save(record)
        return finished
    old: Record | None = None
    try:
        old = database.find(type(record), record.address)
        if record.has_failed:
            database.save(record)
        else:
            _replace_results(finished, folder, database, old)
    except OSError as problem:
        if old is not None:
            with contextlib.suppress(OSError):
                database.save(old)
        trouble = not_written(problem, record.address, str(folder.path))
        finished = replace(not_done(record, old, trouble), workspace=finished.workspace)
    if finished.workspace:  # after an interruption it stays, for `recover`
        shutil.rmtree(folder.path / finished.workspace, ignore_errors=True)
    return finished


def _replace_results(finished: Finished, folder: OutputFolder, database: RecordDatabase, old: Record | None) -> None:
    record = finished.record
    if old is not None:
        database.delete(type(record), record.address)
    targets = {folder.path / output: folder.path / file for output, file in finished.made.items()}
    for target in sorted(targets, key=lambda target: target.exists()):
        target.parent.mkdir(parents=True, exist_ok=True)
        targets[target].replace(target)
    for output in set(finished.superseded) - set(record.files):
        (folder.path / output).unlink(missing_ok=True)
    database.save(record)


def recover(run: str, folder: OutputFolder, database: RecordDatabase) -> None:
    """Publish the jobs that an interrupted run had finished and not yet published.

    Parameters
    ----------
    run : str
        The last run before this one. Results of earlier runs are not recovered: others may have taken their paths.
    folder : OutputFolder
        The output folder.
    database : RecordDatabase
        Its job records.
    """
    for result in sorted(folder.unfinished(run).glob(f"*/{_RESULT}")):
        finished = _left_in(result.parent, folder)
        if finished is not None:
            publish(finished, folder, database)


def _left_in(path: Path, folder: OutputFolder) -> Finished | None:
    """Return the finished job in a workspace, or ``None`` if it is damaged or of another version of anglecam."""
    try:
        content = json.loads((path / _RESULT).read_bytes())
        found = content["record"]
        record: Record = record_from_dict(ClipRecord if "row" in found else SessionRecord, found)
        made, superseded = dict(content["made"]), tuple(content["superseded"])
    except (OSError, ValueError, TypeError, KeyError):
        return None
    remaining = {output: file for output, file in made.items() if (folder.path / file).exists()}
    # the interrupted run has moved the others
    expected = {remaining.get(output, output): size for output, size in record.files.items()}
    if not folder.has(expected):
        return None
    return Finished(record, made=remaining, superseded=superseded, workspace=str(path.relative_to(folder.path)))


def _synchronise(file: Path) -> None:
    """Write a file through to the disk."""
    with file.open("rb") as stream:
        os.fsync(stream.fileno())
