"""The index: what became of every clip, as a table for people and one for DuckDB and pandas."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import astuple, fields
from pathlib import Path

import pyarrow as pa
from pyarrow import parquet

from anglecam.batch.records import move_in
from anglecam.batch.row import Row

_TYPES = {"int | None": pa.int64(), "float | None": pa.float64()}
SCHEMA = pa.schema([(field.name, _TYPES.get(str(field.type), pa.string())) for field in fields(Row)])
"""Column names and types, the same whatever the rows hold."""


def write_index(rows: Sequence[Row], out: Path, unfinished: Path) -> None:
    """Write ``index.csv`` and ``index.parquet``, each whole or not at all.

    Parameters
    ----------
    rows : sequence of Row
        In any order; they are written in that of their paths.
    out : Path
        The output folder.
    unfinished : Path
        Where the files are made.

    Raises
    ------
    OSError
        Where they cannot be written.
    """
    table = [astuple(row) for row in sorted(rows, key=lambda row: row.path)]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(SCHEMA.names)
    writer.writerows(table)
    move_in(text.getvalue().encode(), out / "index.csv", unfinished)
    columns = [pa.array([cells[i] for cells in table], field.type) for i, field in enumerate(SCHEMA)]
    made = io.BytesIO()
    parquet.write_table(pa.Table.from_arrays(columns, schema=SCHEMA), made)
    move_in(made.getvalue(), out / "index.parquet", unfinished)
