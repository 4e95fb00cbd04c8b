"""``NAME.angles.csv``: an angle series as a table for people, in degrees and pixels.

A frame that could not be measured has empty cells and its cause as ``status``.
"""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anglecam.data.series import CONTRACT_RADII_PX, OK, STATUSES, AngleSeries
from anglecam.errors import InputError
from anglecam.io.csv_columns import SERIES_COLUMNS, read_columns, require_increasing
from anglecam.io.files import write_atomically


def write_series(series: AngleSeries, path: Path) -> None:
    """Write ``NAME.angles.csv``: a row a frame, degrees, empty cells where a frame could not be measured.

    Parameters
    ----------
    series : AngleSeries
        The recording; radii in ``series.bounds`` beyond 6 px and 10 px become columns after ``status``.
    path : Path
        The file; it appears whole or not at all.
    """
    columns = series_columns(series)
    with write_atomically(path) as stream:
        rows = csv.writer(stream, lineterminator="\n")
        rows.writerow(columns)
        for cells in zip(*columns.values(), strict=True):
            rows.writerow([_written(name, cell) for name, cell in zip(columns, cells, strict=True)])


def series_columns(series: AngleSeries) -> dict[str, NDArray]:
    """Return a series as the columns of its file, by name and in order: degrees, pixels, NaN for an empty cell.

    Parameters
    ----------
    series : AngleSeries
        The recording; radii in ``series.bounds`` beyond 6 px and 10 px become columns after ``status``.

    Returns
    -------
    dict of str to ndarray
        Each of length n.
    """
    n = len(series.time)
    empty = np.full((n, 2), np.nan)
    mouth = empty if series.mark_px is None else series.mark_px
    pivot = empty if series.pivot_px is None else series.pivot_px
    line = empty[:, 0] if series.line is None else series.line
    more = sorted(set(series.bounds) - set(CONTRACT_RADII_PX))
    bounds = {r: np.degrees(series.bounds.get(r, empty[:, 0])) for r in (*CONTRACT_RADII_PX, *more)}
    angle, sigma = np.degrees(series.angle), np.degrees(series.sigma)
    known = [bounds[r] for r in CONTRACT_RADII_PX]
    cells = [np.arange(n), series.time, angle, sigma, *known, np.degrees(line), *mouth.T, *pivot.T]
    columns = dict(zip(SERIES_COLUMNS, [*cells, np.array(series.status, dtype=str)], strict=True))
    return columns | {f"bound_{r:g}px_deg": bounds[r] for r in more}


def read_series(path: Path) -> AngleSeries:
    """Read an angle series, ours or from elsewhere: ``time_s,angle_deg[,sigma_deg]`` and more columns.

    Parameters
    ----------
    path : Path
        ``NAME.angles.csv`` with a header; a row whose ``angle_deg`` is empty or NaN is a frame without a measurement.

    Returns
    -------
    AngleSeries
        With ``mark_px`` and ``pivot_px`` where the file holds them.

    Raises
    ------
    InputError
        Where the file has no usable header, a cell is no number, times do not increase or nothing is measured.
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
    points = {
        mark: np.column_stack([table[f"{mark}_x_px"], table[f"{mark}_y_px"]])
        for mark in ("mouth", "pivot")
        if f"{mark}_x_px" in table and f"{mark}_y_px" in table
    }
    line = np.radians(table["line_deg"]) if "line_deg" in table else None
    name = path.name.removesuffix(".csv").removesuffix(".angles")
    return AngleSeries(name, time, angle, sigma, status, line, points.get("mouth"), points.get("pivot"))


def _written(column: str, value: Any) -> str:
    """Write a cell: time to nine digits, angles to a millionth of a degree, else four digits."""
    if column in ("frame", "status"):
        return str(value)
    if column == "time_s":
        return f"{value:.9g}"
    digits = 6 if column in ("angle_deg", "sigma_deg", "line_deg") else 4
    return f"{value:.{digits}f}" if math.isfinite(value) else ""
