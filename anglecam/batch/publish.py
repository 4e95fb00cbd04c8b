"""From a finished job to results in place and a job record.

A worker, on this machine or another, makes a job's results in a workspace inside the output folder and ends with
`finish`. The batch's own process then calls `publish`, which moves the results to their output paths and saves the
record. Publishing in one process means that the database has a single writer. The order of its steps ensures that a
record only ever describes results that are in place:

1. delete the old record;
2. move the new results to their paths, and remove old results that have no successor;
3. save the new record.

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
from anglecam.batch.records import ClipRecord, Record, SessionRecord, record_from_dict
from anglecam.batch.row import cannot_write

_RESULT = "result.json"


@dataclass(frozen=True)
class Finished:
    """What a worker returns for a job."""

    record: Record
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
        A failure if the results cannot be written.
    """
    # after a change of output path the old results may belong to another clip
    superseded = tuple(before.files) if before is not None and before.output_path == record.output_path else ()
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
        return Finished(_not_written(record, problem), superseded=superseded)
    return Finished(record, made=inside, superseded=superseded, workspace=str(path.relative_to(folder.path)))


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
        The same, or a failure if results or record cannot be written. There is then no record of new results.
    """
    record = finished.record
    if not finished.to_publish:
        return finished
    if finished.unchanged:  # such as a clip with a new stamp and the same content
        with contextlib.suppress(OSError):
            database.save(record)
        return finished
    try:
        if database.find(type(record), record.address) is not None:
            database.delete(type(record), record.address)
        for output, file in finished.made.items():
            target = folder.path / output
            target.parent.mkdir(parents=True, exist_ok=True)
            (folder.path / file).replace(target)
        for output in set(finished.superseded) - set(record.files):
            (folder.path / output).unlink(missing_ok=True)
        database.save(record)
    except OSError as problem:
        finished = replace(finished, record=_not_written(record, problem))
    if finished.workspace:  # after an interruption it stays, for `recover`
        shutil.rmtree(folder.path / finished.workspace, ignore_errors=True)
    return finished


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


def _not_written(record: Record, problem: OSError) -> Record:
    """Return a record of the failure to write; a failure that was known before keeps its cause."""
    cause = record.row.cause if isinstance(record, ClipRecord) else record.cause
    return record.failed(cause if record.has_failed and cause else cannot_write(problem), transient=True)


def _synchronise(file: Path) -> None:
    """Write a file through to the disk."""
    with file.open("rb") as stream:
        os.fsync(stream.fileno())
