"""The database of job records: one SQLite file in the output folder, ``DIR/.anglecam/batch.sqlite``.

Only the process that holds the folder's lock opens it. Workers on other machines return their records to that process.

A batch may be killed at any instant, and the folder may be shared over a network, so the file uses a rollback journal
in TRUNCATE mode with full synchronisation. A transaction that a kill interrupts is rolled back from the journal by the
next batch, on whichever machine it runs. A write-ahead log (WAL) would need memory shared between all processes that
open the file, which network file systems do not provide. TRUNCATE ends a transaction by truncating the journal and
synchronising it. The default mode, DELETE, deletes the journal without synchronising the folder: after a power failure
the journal can reappear and roll back a committed transaction, so that a deleted record would come back after its
results were replaced.

The tables ``clips`` and ``sessions`` have a column for every field of `ClipRecord` (with those of its `Row`) and of
`SessionRecord`. A database with other columns is of another version of anglecam. It is emptied, and the clips are
measured anew.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import sqlite3
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import Field, asdict, fields
from pathlib import Path
from typing import Any

from anglecam.batch.records import AnyRecord, ClipRecord, Record, SessionRecord, record_from_dict
from anglecam.batch.row import Row
from anglecam.errors import RigError

_WAIT_S = 30.0
"""How long to wait, in s, while another program, such as the ``sqlite3`` shell, reads the database."""

_TABLES: dict[type, str] = {ClipRecord: "clips", SessionRecord: "sessions"}
_FIELDS: dict[type, tuple[Field[Any], ...]] = {
    ClipRecord: tuple(f for kind in (ClipRecord, Row) for f in fields(kind) if f.name != "row"),
    SessionRecord: fields(SessionRecord),
}
_COLUMN_TYPES = {
    "int | None": "INTEGER",
    "float | None": "REAL",
    "bool": "INTEGER",
    "str": "TEXT",
    "str | None": "TEXT",
}
_PATHS = ("address", "output_path")
"""Stored as bytes: the name of a file need not be valid text."""


def _definition(kind: type[Record]) -> str:
    columns = [
        f"{f.name} BLOB{' PRIMARY KEY' * (f.name == 'address')}"
        if f.name in _PATHS
        else f"{f.name} {_COLUMN_TYPES.get(str(f.type), 'TEXT')}"
        for f in _FIELDS[kind]
    ]
    return f"CREATE TABLE {_TABLES[kind]} ({', '.join(columns)}) WITHOUT ROWID"


_DEFINITIONS = tuple(_definition(kind) for kind in _TABLES)
_VERSION = zlib.crc32("\n".join(_DEFINITIONS).encode()) & 0x7FFFFFFF
"""Stored as the file's ``user_version``."""


class RecordDatabase:
    """The job records of one output folder; use it in a ``with`` block.

    Parameters
    ----------
    file : Path
        The SQLite file. It is made if missing, and made anew if it is damaged.
    """

    def __init__(self, file: Path) -> None:
        self._file = file

    def __enter__(self) -> RecordDatabase:
        self._connection = self._connect()
        return self

    def __exit__(self, *_: object) -> None:
        self._connection.close()

    def read_all(self, kind: type[AnyRecord]) -> list[AnyRecord]:
        """Return the records of all clips, or of all sessions.

        Raises
        ------
        RigError
            If the database exists and cannot be read.
        """
        try:
            return self._read(kind)
        except sqlite3.OperationalError as problem:  # full, locked or inaccessible
            out = self._file.parent.parent
            raise RigError(f"--out {out}: {self._file} cannot be read ({problem})") from problem
        except (sqlite3.DatabaseError, ValueError, TypeError):  # damaged
            self._start_anew()
            return []

    def find(self, kind: type[AnyRecord], address: str) -> AnyRecord | None:
        """Return the record of one clip or session, or ``None``.

        Raises
        ------
        OSError
            If the database cannot be read.
        """
        with _as_os_errors():
            return next(iter(self._read(kind, "WHERE address = ?", (os.fsencode(address),))), None)

    def save(self, *records: Record) -> None:
        """Add records, or replace those of the same addresses, in one transaction.

        Raises
        ------
        OSError
            If the database cannot be written. It then holds what it held before.
        """
        with self._transaction() as connection:
            for record in records:
                columns = _columns(record)
                names, marks = ", ".join(columns), ", ".join("?" * len(columns))
                table = _TABLES[type(record)]
                connection.execute(f"REPLACE INTO {table} ({names}) VALUES ({marks})", tuple(columns.values()))

    def delete(self, kind: type[Record], address: str) -> None:
        """Delete the record of one clip or session, if there is one.

        Raises
        ------
        OSError
            If the database cannot be written. It then holds what it held before.
        """
        with self._transaction() as connection:
            connection.execute(f"DELETE FROM {_TABLES[kind]} WHERE address = ?", (os.fsencode(address),))

    def _start_anew(self) -> None:
        self._connection.close()
        try:
            for file in (self._file, self._file.with_name(f"{self._file.name}-journal")):
                file.unlink(missing_ok=True)
        except OSError as problem:
            out = self._file.parent.parent
            raise RigError(
                f"--out {out}: {self._file} is damaged and cannot be removed ({problem.strerror})"
            ) from problem
        self._connection = self._connect()

    def _connect(self) -> sqlite3.Connection:
        try:
            connection = sqlite3.connect(self._file, timeout=_WAIT_S, isolation_level=None)
        except sqlite3.OperationalError as problem:
            raise RigError(f"--out {self._file.parent.parent}: {self._file} cannot be opened ({problem})") from problem
        connection.row_factory = sqlite3.Row
        return connection

    def _read(self, kind: type[AnyRecord], where: str = "", values: tuple[bytes, ...] = ()) -> list[AnyRecord]:
        if not self._is_current():
            return []
        found = self._connection.execute(f"SELECT * FROM {_TABLES[kind]} {where}", values)
        return [_record(kind, row) for row in found]

    def _is_current(self) -> bool:
        """Return whether the tables are there and of this version."""
        return bool(self._connection.execute("PRAGMA user_version").fetchone()[0] == _VERSION)

    @contextmanager
    def _transaction(self) -> Iterator[sqlite3.Connection]:
        """Run a block as one transaction; make the tables first if they are missing or of another version."""
        connection = self._connection
        with _as_os_errors():
            connection.execute("PRAGMA journal_mode = TRUNCATE")
            connection.execute("PRAGMA synchronous = FULL")
            connection.execute("BEGIN IMMEDIATE")
            try:
                if not self._is_current():
                    for table, definition in zip(_TABLES.values(), _DEFINITIONS, strict=True):
                        connection.execute(f"DROP TABLE IF EXISTS {table}")
                        connection.execute(definition)
                    connection.execute(f"PRAGMA user_version = {_VERSION}")
                yield connection
                connection.execute("COMMIT")
            except BaseException:
                with contextlib.suppress(sqlite3.Error):  # SQLite has rolled back by itself after some errors
                    connection.execute("ROLLBACK")
                raise


@contextmanager
def _as_os_errors() -> Iterator[None]:
    """Raise SQLite's errors as `OSError`, as every other failure to read or write is raised."""
    try:
        yield
    except sqlite3.Error as problem:
        full = getattr(problem, "sqlite_errorcode", None) == sqlite3.SQLITE_FULL
        raise OSError(errno.ENOSPC if full else errno.EIO, str(problem)) from problem


def _columns(record: Record) -> dict[str, Any]:
    """Return the values of a record's columns by their names."""
    found = asdict(record)
    found |= found.pop("row", {})
    return {
        name: os.fsencode(value)
        if name in _PATHS
        else json.dumps(value)
        if isinstance(value, dict | tuple | list)
        else value
        for name, value in found.items()
    }


def _record(kind: type[AnyRecord], row: sqlite3.Row) -> AnyRecord:
    """Return the record that `_columns` turned into a row of a table."""
    found: dict[str, Any] = {}
    for field in _FIELDS[kind]:
        value = row[field.name]
        if field.name in _PATHS:
            value = os.fsdecode(value)
        elif field.type == "bool":
            value = bool(value)
        elif value is not None and str(field.type) not in _COLUMN_TYPES:
            value = json.loads(value)
        found[field.name] = value
    if kind is ClipRecord:
        found["row"] = {field.name: found.pop(field.name) for field in fields(Row)}
    return record_from_dict(kind, found)
