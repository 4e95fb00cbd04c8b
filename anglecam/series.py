"""The angle of one recording over time, as it passes between the rooms of anglecam and as it stands in a file.

Inside, angles are radians and a frame that could not be measured is NaN; in files, angles are degrees and such
a frame's columns are empty. Nothing here knows where an angle comes from.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anglecam.errors import InputError
from anglecam.files import write_atomically

CORRECTED = "corrected"
"""Folder of a session's series without what the camera did."""
OK = "ok"
STATUSES = (OK, "no_mouth", "occluded", "ambiguous", "no_pivot", "duplicate", "undecodable")
"""``ok`` or why a frame has no angle."""

COLUMNS = (
    "frame",
    "time_s",
    "angle_deg",
    "sigma_deg",
    "bound_6px_deg",
    "bound_10px_deg",
    "line_deg",
    "mouth_x_px",
    "mouth_y_px",
    "pivot_x_px",
    "pivot_y_px",
    "status",
)
CONTRACT_RADII_PX = (6.0, 10.0)

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class AngleSeries:
    """One recording's angle, frame by frame; arrays of length n, NaN where ``status`` is not ``ok``."""

    name: str
    """The recording's name: the clip's file name without its ending."""
    time: Floats
    """Seconds on the clip's own clock, strictly increasing."""
    angle: Floats
    """Nodding angle from neutral, rad, an upward nod positive."""
    sigma: Floats
    """Standard uncertainty of ``angle``, rad; NaN throughout where the source states none."""
    status: tuple[str, ...]
    """One of `STATUSES` for each frame."""
    line: Floats | None = None
    """Absolute direction of the line pivot→mouth from the image's horizontal, rad."""
    mouth_px: Floats | None = None
    """(n, 2) mouth point, x to the right and y down, px."""
    pivot_px: Floats | None = None
    """(n, 2) pivot, px."""
    bounds: dict[float, Floats] = field(default_factory=dict)
    """Worst-case angle error, rad, for a mouth point anywhere within the key's radius in px."""
    picture_px: tuple[int, int] | None = None
    """Width and height of the picture; ``None`` where it is not known."""
    marker_px: tuple[float, float] | None = None
    """Where a picture that nothing was undone in shows the mark on the shaft; ``None`` where it does not."""
    only_pivot_differs: bool | None = None
    """Of an angle of the line from this mark: whether that is all by which it differs from the measured one."""

    @property
    def ok(self) -> NDArray[np.bool_]:
        """Frames whose angle is measured."""
        return np.array([s == OK for s in self.status])


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
    mouth = empty if series.mouth_px is None else series.mouth_px
    pivot = empty if series.pivot_px is None else series.pivot_px
    line = empty[:, 0] if series.line is None else series.line
    more = sorted(set(series.bounds) - set(CONTRACT_RADII_PX))
    bounds = {r: np.degrees(series.bounds.get(r, empty[:, 0])) for r in (*CONTRACT_RADII_PX, *more)}
    angle, sigma = np.degrees(series.angle), np.degrees(series.sigma)
    known = [bounds[r] for r in CONTRACT_RADII_PX]
    cells = [np.arange(n), series.time, angle, sigma, *known, np.degrees(line), *mouth.T, *pivot.T]
    columns = dict(zip(COLUMNS, [*cells, np.array(series.status, dtype=str)], strict=True))
    return columns | {f"bound_{r:g}px_deg": bounds[r] for r in more}


def read_series(path: Path) -> AngleSeries:
    """Read an angle series, ours or from elsewhere: ``time_s,angle_deg[,sigma_deg]`` and more columns.

    Parameters
    ----------
    path : Path
        ``NAME.angles.csv`` with a header; a row with an empty ``angle_deg`` is a frame without a measurement.

    Returns
    -------
    AngleSeries
        With ``mouth_px`` and ``pivot_px`` where the file holds them.

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


def read_columns(path: Path, *, required: Sequence[str], may_be_empty: bool = False) -> dict[str, NDArray]:
    """Read a CSV file's columns by name: those that anglecam knows as float arrays, others as text.

    Parameters
    ----------
    path : Path
        A CSV file with a header line.
    required : sequence of str
        Columns that must be there.
    may_be_empty : bool
        Whether an empty cell of a numeric column is NaN instead of an error (``time_s`` never may be).

    Returns
    -------
    dict of str to ndarray
        Every column of the file.

    Raises
    ------
    InputError
        Naming the file, the line and the cause.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as stream:
            rows = list(csv.reader(stream))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: cannot be read as CSV ({_reason(error)})") from error
    if not rows or not any(cell.strip() for cell in rows[0]):
        raise InputError(f"{path}: empty file; expected a header with {','.join(required)}")
    header = [cell.strip() for cell in rows[0]]
    missing = [name for name in required if name not in header]
    if missing:
        raise InputError(f"{path}: no column {missing[0]} in the header ({','.join(header)[:80]})")
    columns: dict[str, list] = {name: [] for name in header}
    for number, row in enumerate(rows[1:], start=2):
        if not any(cell.strip() for cell in row):
            continue
        if len(row) != len(header):
            raise InputError(f"{path}: line {number} has {len(row)} cells, the header has {len(header)}")
        for name, cell in zip(header, row, strict=True):
            numeric = name in required or (name in COLUMNS and name != "status")
            columns[name].append(_number(path, number, name, cell.strip(), may_be_empty) if numeric else cell.strip())
    if not columns[header[0]]:
        raise InputError(f"{path}: a header but no rows")
    return {name: np.array(column) for name, column in columns.items()}


def require_increasing(path: Path, time: Floats) -> None:
    """Raise `InputError` naming the row where ``time`` (s) does not increase."""
    backwards = np.flatnonzero(np.diff(time) <= 0)
    if len(backwards):
        i = int(backwards[0])
        raise InputError(f"{path}: times must increase, but row {i + 2} ({time[i + 1]:g} s) follows {time[i]:g} s")


def _number(path: Path, line: int, name: str, cell: str, may_be_empty: bool) -> float:
    if cell == "" and may_be_empty and name != "time_s":
        return math.nan
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{path}: line {line}: {name} is {cell!r}, not a number")
    return value


def _written(column: str, value: Any) -> str:
    """Write a cell: time to nine digits, angles to a millionth of a degree, else four digits."""
    if column in ("frame", "status"):
        return str(value)
    if column == "time_s":
        return f"{value:.9g}"
    digits = 6 if column in ("angle_deg", "sigma_deg", "line_deg") else 4
    return f"{value:.{digits}f}" if math.isfinite(value) else ""


def _reason(error: Exception) -> str:
    return error.strerror if isinstance(error, OSError) and error.strerror else str(error).splitlines()[0]
