"""Read CSV files by the names of their columns, within limits of size."""

from __future__ import annotations

import csv
import math
from array import array
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from anglecam.data.series import SERIES_COLUMNS, STATUSES
from anglecam.data.typing import Floats
from anglecam.errors import InputError
from anglecam.io.files import open_text

_MOST_BYTES = 256 * 2**20
"""Size above which a file is not read."""
_MOST_ROWS = 1_000_000
"""Rows above which a file is not read: nine hours at 30 Hz. A row of anglecam's files has 160 bytes."""
_LONGEST_STATUS = max(map(len, STATUSES)) + 1
"""Characters at which a status is cut; one more than the longest, so that a cut status equals none of them."""
_LARGEST = 1e12
"""Largest number that is read; no time in s, angle in degrees or coordinate in px reaches it. Its square is finite."""


def read_columns(path: Path, *, required: Sequence[str], may_be_empty: bool = False) -> dict[str, NDArray]:
    """Read the required columns of a CSV file and those of an angle series: numbers as floats, ``status`` as text.

    Parameters
    ----------
    path : Path
        A CSV file with a header line.
    required : sequence of str
        Columns that the file must have.
    may_be_empty : bool
        Whether an empty cell or ``nan`` in a numeric column is read as NaN instead of being an error; in ``time_s`` it
        is always an error.

    Returns
    -------
    dict of str to ndarray
        The required columns, and those of `SERIES_COLUMNS` that the file has.

    Raises
    ------
    InputError
        If the file cannot be read, lacks a column or has a wrong cell; the line names the file, the row and the cause.
    """
    try:
        with open_text(path, _MOST_BYTES) as stream:
            rows = csv.reader(stream)
            header = [cell.strip() for cell in next(rows, ())]
            known = _known(path, header, required)
            numbers = {name: array("d") for name in known if name != "status"}
            status: list[str] = []
            n = 0
            for number, row in enumerate(rows, start=2):
                if not any(cell.strip() for cell in row):
                    continue
                if len(row) != len(header):
                    raise InputError(f"{path}: line {number} has {len(row)} cells, the header has {len(header)}")
                n += 1
                if n > _MOST_ROWS:
                    raise InputError(f"{path}: more than {_MOST_ROWS:,} rows are not read")
                for name, column in numbers.items():
                    column.append(_number(path, number, name, row[known[name]].strip(), may_be_empty))
                if "status" in known:
                    status.append(row[known["status"]].strip()[:_LONGEST_STATUS])
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: cannot be read as CSV ({_reason(error)})") from error
    if not n:
        raise InputError(f"{path}: a header but no rows")
    columns: dict[str, NDArray] = {name: np.asarray(column) for name, column in numbers.items()}
    return columns | ({"status": np.array(status)} if "status" in known else {})


def _known(path: Path, header: list[str], required: Sequence[str]) -> dict[str, int]:
    """Return the columns of a header that are to be read, with their positions."""
    if not any(header):
        raise InputError(f"{path}: empty file; expected a header with {','.join(required)}")
    missing = [name for name in required if name not in header]
    if missing:
        raise InputError(f"{path}: no column {missing[0]} in the header ({','.join(header)[:80]})")
    known = {name: i for i, name in enumerate(header) if name in required or name in SERIES_COLUMNS}
    twice = [name for name in known if header.count(name) > 1]
    if twice:
        raise InputError(f"{path}: column {twice[0]} appears twice in the header")
    return known


def require_increasing(path: Path, time: Floats) -> None:
    """Raise `InputError` naming the row where ``time`` (s) does not increase."""
    backwards = np.flatnonzero(np.diff(time) <= 0)
    if len(backwards):
        i = int(backwards[0])
        raise InputError(f"{path}: times must increase, but row {i + 2} ({time[i + 1]:g} s) follows {time[i]:g} s")


def _number(path: Path, line: int, name: str, cell: str, may_be_empty: bool) -> float:
    if may_be_empty and name != "time_s" and cell.lower() in ("", "nan"):
        return math.nan
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{path}: line {line}: {name} is {cell[:40]!r}, not a number")
    if abs(value) > _LARGEST:
        raise InputError(f"{path}: line {line}: {name} is {value:g}, which is too large for a recording")
    return value


def _reason(error: Exception) -> str:
    return error.strerror if isinstance(error, OSError) and error.strerror else str(error).splitlines()[0]
