"""Read a servo's log of voltage and current."""

from __future__ import annotations

from pathlib import Path

from anglecam.errors import InputError
from anglecam.io.csv_columns import read_columns, require_increasing
from anglecam.neck.power import PowerLog


def read_power_log(path: Path) -> PowerLog:
    """Read a log of voltage and current.

    Parameters
    ----------
    path : Path
        CSV with ``time_s,voltage_v,current_a``; further columns are ignored.

    Returns
    -------
    PowerLog
        Unfiltered.

    Raises
    ------
    InputError
        With the file, the line and the cause.
    """
    table = read_columns(path, required=("time_s", "voltage_v", "current_a"))
    require_increasing(path, table["time_s"])
    if len(table["time_s"]) < 3:
        raise InputError(f"{path}: {len(table['time_s'])} rows; at least 3 are needed")
    return PowerLog(str(path), table["time_s"], table["voltage_v"], table["current_a"])
