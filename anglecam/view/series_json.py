"""The angles of a clip, as the page receives them: the columns of ``NAME.angles.csv``, and the command."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from anglecam.io.csv_columns import read_columns
from anglecam.io.rig import Rig
from anglecam.io.series_csv import read_series
from anglecam.io.session import command_beside
from anglecam.view.folder import Folder

_COLUMNS = (
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
)


def series_as_dict(folder: Folder, clip: Path, rig: Rig) -> dict[str, Any] | None:
    """Return the measured angles of a clip.

    Parameters
    ----------
    folder : Folder
        In which its results are.
    clip : Path
        The clip.
    rig : Rig
        Declares what the rows of a command mean.

    Returns
    -------
    dict or None
        Columns of equal length by name, NaN where a cell is empty, with ``status`` and ``first_frame``; ``command``
        with ``time_s`` and ``angle_deg``, or ``None``; ``outdated``, the names of clip and rig file where they are
        younger than the angles. ``None`` where the clip is not measured.

    Raises
    ------
    InputError
        Where the file is damaged.
    """
    path = folder.series_file(clip)
    if not path.is_file():
        return None
    series = read_series(path)
    table = read_columns(path, required=("time_s", "angle_deg"), may_be_empty=True)
    written = path.stat().st_mtime
    younger = [p.name for p in (clip, folder.rig_file) if p.exists() and p.stat().st_mtime > written]
    return {
        **{name: table[name].tolist() for name in _COLUMNS if name in table},
        "status": list(series.status),
        "first_frame": series.first_frame,
        "outdated": younger,
        "command": _command(folder, clip, rig),
    }


def _command(folder: Folder, clip: Path, rig: Rig) -> dict[str, Any] | None:
    command = command_beside(folder.inside(clip), rig)
    if command is None:
        return None
    return {"time_s": command.time.tolist(), "angle_deg": np.degrees(command.angle).tolist()}
