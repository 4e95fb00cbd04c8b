"""``NAME.angles.csv``: an angle series as a table in degrees and pixels.

A frame without an angle has empty cells, and its ``status`` is the cause.
"""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anglecam.data.derivatives import Derivatives
from anglecam.data.series import DERIVATIVE_COLUMNS, OK, STATUSES, AngleSeries
from anglecam.errors import InputError
from anglecam.io.csv_columns import read_columns, require_increasing
from anglecam.io.files import write_atomically


def write_series(series: AngleSeries, path: Path) -> None:
    """Write ``NAME.angles.csv``: one row for each frame, angles in degrees, empty cells for a frame without an angle.

    Parameters
    ----------
    series : AngleSeries
        The recording. Radii of ``series.bounds`` other than 6 px and 10 px become the last columns.
    path : Path
        The file; it is written whole or not at all.
    """
    columns = series.columns()
    with write_atomically(path) as stream:
        rows = csv.writer(stream, lineterminator="\n")
        rows.writerow(columns)
        for cells in zip(*columns.values(), strict=True):
            rows.writerow([_cell(name, cell) for name, cell in zip(columns, cells, strict=True)])


def read_series(path: Path) -> AngleSeries:
    """Read an angle series that anglecam or another program wrote; required are ``time_s,angle_deg``.

    Parameters
    ----------
    path : Path
        ``NAME.angles.csv`` with a header. A row whose ``angle_deg`` is empty or NaN is a frame without an angle.

    Returns
    -------
    AngleSeries
        With ``mark_px`` and ``pivot_px`` if the file has their columns.

    Raises
    ------
    InputError
        If the header lacks a column, a cell is not a number, times do not increase or fewer than 3 angles are measured.
    """
    table = read_columns(path, required=("time_s", "angle_deg"), may_be_empty=True)
    time, angle = table["time_s"], np.radians(table["angle_deg"])
    n = len(time)
    require_increasing(path, time)
    measured = np.isfinite(angle)
    stated = table.get("status", ())
    status = tuple(
        (stated[i] if i < len(stated) and stated[i] in STATUSES else OK)
        if measured[i]
        else (stated[i] if i < len(stated) and stated[i] in STATUSES[1:] else "no_mouth")
        for i in range(n)
    )
    angle = np.where([s == OK for s in status], angle, np.nan)
    if np.isfinite(angle).sum() < 3:
        raise InputError(f"{path}: fewer than 3 measured angles in {n} rows")
    sigma = np.radians(table["sigma_deg"]) if "sigma_deg" in table else np.full(n, np.nan)
    random = np.radians(table["sigma_random_deg"]) if "sigma_random_deg" in table else None
    points = {
        point: np.column_stack([table[f"{point}_x_px"], table[f"{point}_y_px"]])
        for point in ("mouth", "pivot")
        if f"{point}_x_px" in table and f"{point}_y_px" in table
    }
    line = np.radians(table["line_deg"]) if "line_deg" in table else None
    name = path.name.removesuffix(".csv").removesuffix(".angles")
    rates = [np.radians(table[name]) for name in DERIVATIVE_COLUMNS if name in table]
    first = _first_frame(table.get("frame"))
    return AngleSeries(
        name,
        time,
        angle,
        sigma,
        status,
        line,
        points.get("mouth"),
        points.get("pivot"),
        first_frame=first,
        sigma_random=random,
        derivatives=Derivatives(*rates) if len(rates) == len(DERIVATIVE_COLUMNS) else None,
    )


def _first_frame(numbers: NDArray | None) -> int:
    """Return the first of numbers that count frames one by one, else 0."""
    counts = numbers is not None and np.isfinite(numbers).all() and (np.diff(numbers) == 1.0).all()
    return int(numbers[0]) if counts and numbers is not None and numbers[0] == np.floor(numbers[0]) else 0


def _cell(column: str, value: Any) -> str:
    """Return a cell's text: times with nine significant digits, angles with six decimals, all else with four."""
    if column in ("frame", "status"):
        return str(value)
    if column == "time_s":
        return f"{value:.9g}"
    digits = 4 if column.startswith("bound_") or column.endswith("_px") else 6
    return f"{value:.{digits}f}" if math.isfinite(value) else ""
