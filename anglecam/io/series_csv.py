"""The angle of one recording over time, as it passes between the rooms of anglecam and as it stands in a file.

Inside, angles are radians and a frame that could not be measured is NaN; in files, angles are degrees and such
a frame's columns are empty. Nothing here knows where an angle comes from.
"""

from __future__ import annotations

import csv
import math
from array import array
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anglecam.errors import InputError
from anglecam.io.files import open_text, write_atomically

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
_MOST_BYTES = 256 * 2**20
_MOST_ROWS = 1_000_000
"""Nine hours at 30 Hz; a file of ours has 110 bytes for each."""
_LONGEST_STATUS = max(map(len, STATUSES)) + 1
"""Characters; longer than any, so that what is cut is none of them."""
_LARGEST = 1e12
"""No time in s, angle in degrees or place in px is as large; squares of what is smaller stay finite."""

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
    by_mouth: bool = False
    """Whether the angle was read off the mouth's own place; else that place is a second witness."""
    own_turn: tuple[float, float] | None = None
    """Share by which a mouth that was measured alone turns more than the line to it, and its standard uncertainty."""
    lamp_s: tuple[float, float] | None = None
    """Between which instants the lamp was lit that shows the first command change, s on the clip's clock."""
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
        ``NAME.angles.csv`` with a header; a row whose ``angle_deg`` is empty or NaN is a frame without a measurement.

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
    """Read those columns of a CSV file that anglecam knows, by name: numbers as floats, ``status`` as text.

    Parameters
    ----------
    path : Path
        A CSV file with a header line.
    required : sequence of str
        Columns that must be there.
    may_be_empty : bool
        Whether an empty cell of a numeric column, or one that says so, is NaN instead of an error (``time_s`` never
        may be).

    Returns
    -------
    dict of str to ndarray
        The columns that are required, and those of an angle series that are there.

    Raises
    ------
    InputError
        Naming the file, the line and the cause.
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
    """Return which of a header's columns are to be read, and where they stand."""
    if not any(header):
        raise InputError(f"{path}: empty file; expected a header with {','.join(required)}")
    missing = [name for name in required if name not in header]
    if missing:
        raise InputError(f"{path}: no column {missing[0]} in the header ({','.join(header)[:80]})")
    known = {name: i for i, name in enumerate(header) if name in required or name in COLUMNS}
    twice = [name for name in known if header.count(name) > 1]
    if twice:
        raise InputError(f"{path}: column {twice[0]} stands twice in the header")
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
        raise InputError(f"{path}: line {line}: {name} is {value:g}; no recording has that")
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
