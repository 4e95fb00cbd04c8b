"""The index: one row for every clip, as CSV, as Parquet for DuckDB and pandas, and as a page for people."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import astuple, fields

import pyarrow as pa
from pyarrow import parquet

from anglecam.batch.output_folder import OutputFolder
from anglecam.batch.row import Row
from anglecam.report.index_page import index_html

_TYPES = {"int | None": pa.int64(), "float | None": pa.float64()}
SCHEMA = pa.schema([(field.name, _TYPES.get(str(field.type), pa.string())) for field in fields(Row)])
"""Column names and types. They do not depend on the content of the rows."""


def write_index(rows: Sequence[Row], folder: OutputFolder, run: str) -> None:
    """Write ``index.csv``, ``index.parquet`` and ``index.html``, each whole or not at all.

    Parameters
    ----------
    rows : sequence of Row
        In any order; they are written in the order of their paths.
    folder : OutputFolder
        The output folder.
    run : str
        The run, in whose unfinished folder the files are made.

    Raises
    ------
    OSError
        If a file cannot be written.
    """
    table = [astuple(row) for row in sorted(rows, key=lambda row: row.path)]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(SCHEMA.names)
    writer.writerows(table)
    folder.write(text.getvalue().encode(), folder.path / "index.csv", run)
    columns = [pa.array([cells[i] for cells in table], field.type) for i, field in enumerate(SCHEMA)]
    made = io.BytesIO()
    parquet.write_table(pa.Table.from_arrays(columns, schema=SCHEMA), made)
    folder.write(made.getvalue(), folder.path / "index.parquet", run)
    page = index_html([dict(zip(SCHEMA.names, cells, strict=True)) for cells in table], folder.path)
    folder.write(page.encode("utf-8", "backslashreplace"), folder.path / "index.html", run)
