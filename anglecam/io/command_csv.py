"""``NAME.command.csv``: what was commanded, beside the recording that it belongs to."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from anglecam.data.command import Command
from anglecam.io.csv_columns import read_columns, require_increasing

COMMAND_ENDING = ".command.csv"


def read_command(path: Path) -> Command:
    """Read ``NAME.command.csv``: ``time_s,command_deg``, held constant until the next row.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    Command
        In radians.

    Raises
    ------
    InputError
        Where a row cannot be read or times do not increase, naming file and line.
    """
    table = read_columns(path, required=("time_s", "command_deg"))
    require_increasing(path, table["time_s"])
    return Command(table["time_s"], np.radians(table["command_deg"]))
