"""Remove stale results: only when asked, and only of clips and sessions whose folders could be searched.

The results of an attempt that may succeed without any change of the inputs (a clip that was still being written) stay.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable
from dataclasses import dataclass, replace

from anglecam.batch.database import RecordDatabase
from anglecam.batch.output_folder import OutputFolder
from anglecam.batch.records import ClipRecord, Record
from anglecam.batch.row import STALE
from anglecam.errors import printable


@dataclass(frozen=True)
class Pruned:
    """What was removed of one clip or session."""

    record: Record
    """Its record before."""
    left: Record | None
    """Its record now; ``None`` if the clip or session is no longer there."""
    files: tuple[str, ...]
    """The removed files, relative to the output folder."""

    @property
    def line(self) -> str:
        """What was removed, and why, in one line."""
        return printable(f"removed {', '.join(self.files)}: {reason(self.record)}")


def reason(record: Record) -> str:
    """Return why results are stale."""
    shown = record.shown.cause if isinstance(record, ClipRecord) else record.shown_cause
    return f"{record.address}: {shown or 'no clip of this session is left'}"


def is_stale(record: Record) -> bool:
    """Return whether there are stale results to remove."""
    if record.in_place is None:
        return False
    if isinstance(record, ClipRecord):
        return record.shown.status == STALE and not record.transient
    return record.has_failed


def prune(records: Iterable[Record], folder: OutputFolder, database: RecordDatabase) -> list[Pruned]:
    """Remove stale results and what the database says of them.

    Parameters
    ----------
    records : iterable of ClipRecord or SessionRecord
        Records with stale results.
    folder : OutputFolder
        The output folder.
    database : RecordDatabase
        Its job records.

    Returns
    -------
    list of Pruned
        One for each record.

    Raises
    ------
    OSError
        If a file or the database cannot be changed. Files that were removed before are missing then, and the next batch
        measures their clips again.
    """
    done = []
    for record in records:
        assert record.in_place is not None
        files = tuple(sorted(file for file in record.in_place.files if (folder.path / file).exists()))
        for file in files:
            (folder.path / file).unlink(missing_ok=True)
            with contextlib.suppress(OSError):  # not empty
                (folder.path / file).parent.rmdir()
        is_gone = record.removed if isinstance(record, ClipRecord) else not record.has_failed
        left = None if is_gone else replace(record, kept=None)
        if left is None:
            database.delete(type(record), record.address)
        else:
            database.save(left)
        done.append(Pruned(record, left, tuple(file for file in files if not file.startswith(".anglecam/"))))
    return done
