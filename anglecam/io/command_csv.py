"""``NAME.command.csv``: the command of the recording NAME."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from anglecam.data.command import Command
from anglecam.io.csv_columns import read_columns, require_increasing

COMMAND_ENDING = ".command.csv"


def read_command(path: Path) -> Command:
    """Read ``NAME.command.csv`` with the columns ``time_s,command_deg``; each value holds until the next row.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    Command
        The command, rad.

    Raises
    ------
    InputError
        If a row cannot be read or times do not increase; the line names the file and the row.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "stairs.command.csv")
    ...     _ = path.write_text(chr(10).join(["time_s,command_deg", "0,0", "1.5,10"]))
    ...     command = read_command(path)
    >>> command.first_change()
    1.5
    """
    table = read_columns(path, required=("time_s", "command_deg"))
    require_increasing(path, table["time_s"])
    return Command(table["time_s"], np.radians(table["command_deg"]))
