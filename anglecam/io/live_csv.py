"""``NAME.live.csv``: what was shown while a film was recorded, a row a frame."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from anglecam.io.files import write_atomically

LIVE_ENDING = ".live.csv"
_COLUMNS = ("frame", "time_s", "status", "angle_deg", "sigma_deg", "latency_ms")
_PARAMETERS = ("a_per_s", "b_per_s2", "c_per_s2")
_Three = tuple[float, float, float]
_UNKNOWN: _Three = (np.nan, np.nan, np.nan)


@dataclass(frozen=True)
class LiveRow:
    """A frame while it was filmed; what is unknown is NaN."""

    frame: int
    time: float
    """s."""
    status: str
    """That of `anglecam.data.series`, or ``learning`` or ``late`` for a frame that was not measured at once."""
    angle: float = np.nan
    """From neutral, rad."""
    sigma: float = np.nan
    """Standard uncertainty of ``angle``, rad."""
    latency: float = np.nan
    """From the instant at which the frame could have been measured to that at which its angle was known, s."""
    parameters: _Three = _UNKNOWN
    """a (1/s), b (1/s²), c (1/s²) by the running filter."""
    parameter_sigmas: _Three = _UNKNOWN
    """Standard uncertainties that the filter states."""


def write_live(rows: Iterable[LiveRow], path: Path) -> None:
    """Write the rows in degrees and milliseconds; the file is written whole or not at all."""
    with write_atomically(path) as stream:
        table = csv.writer(stream, lineterminator="\n")
        table.writerow([*_COLUMNS, *(f"{name}{end}" for name in _PARAMETERS for end in ("", "_sigma"))])
        for row in rows:
            angles = np.degrees([row.angle, row.sigma])
            pairs = np.column_stack([row.parameters, row.parameter_sigmas]).ravel()
            figures = [_cell(v) for v in (*angles, 1e3 * row.latency, *pairs)]
            table.writerow([row.frame, f"{row.time:.9g}", row.status, *figures])


def _cell(value: float) -> str:
    return "" if np.isnan(value) else f"{value:.8g}"
