"""The data that the scripts of a page draw: named columns of every recording, and plots that name them.

A page holds each column once, however many plots show it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from anglecam.data.series import AngleSeries
from anglecam.data.typing import Floats
from anglecam.errors import printable
from anglecam.report.figures import AFTER, COMMAND, MEASURED, NORMAL_95, SHADE

DECIMALS = 6
"""Of seconds and degrees; as many as ``NAME.angles.csv`` has."""


@dataclass(frozen=True)
class Curve:
    """One curve of a plot."""

    column: str
    label: str
    colour: str
    style: str = "line"
    """``line``, ``dots`` or ``step``."""


@dataclass(frozen=True)
class Band:
    """A shaded band of a plot."""

    label: str
    colour: str
    half: str | float
    """Column of half its width, or half its width, °."""
    centre: str | None = None
    """Column of its middle; ``None``: zero."""
    factor: float = 1.0
    """By which ``half`` is multiplied."""
    shown: bool = True
    """Whether it is shown without being asked for."""


@dataclass(frozen=True)
class Plot:
    """A diagram over time."""

    label: str
    """Of the vertical axis, with the unit."""
    curves: tuple[Curve, ...]
    bands: tuple[Band, ...] = ()
    from_zero: bool = False
    """Whether the axis begins at zero."""


@dataclass(frozen=True)
class Columns:
    """One recording's columns, and the number of its first frame."""

    name: str
    first_frame: int
    columns: Mapping[str, Floats]
    """``time`` (s) and others (°), each (n,) with NaN where there is no value."""


SIGMA_BAND = Band("95 % interval (1.96 σ)", SHADE, "sigma", "angle", NORMAL_95)
"""What is known of a measured angle whose uncertainty is not divided into parts."""
RANDOM_BAND = Band("95 % interval of the random part", SHADE, "random", "angle", NORMAL_95)
"""What differs from frame to frame."""
TOTAL_BAND = Band("95 % interval with the common part", "#e3e7ec", "sigma", "angle", NORMAL_95, shown=False)
"""Also what all frames share."""
DERIVATIVES = {"velocity": "°/s", "acceleration": "°/s²"}
"""Units of the columns that `derivative_columns` adds."""


def angle_plot(series: Sequence[Columns], curves: Sequence[Curve] = ()) -> Plot:
    """Return the plot of the measured angle, with its uncertainty and, on demand, its worst-case bounds."""
    names = {name for one in series for name in one.columns}
    command = [Curve("command", "command", COMMAND, "step")] if "command" in names else []
    bands = [TOTAL_BAND, RANDOM_BAND] if "random" in names else [SIGMA_BAND] if "sigma" in names else []
    radii = sorted((n for n in names if n.startswith("bound")), key=lambda n: float(n.removeprefix("bound")))
    bands += [
        Band(f"worst case, mark off by {n.removeprefix('bound')} px", "#f3e3c3", n, "angle", shown=False)
        for n in radii[::-1]
    ]
    return Plot("angle, °", (*command, *curves, Curve("angle", "angle", MEASURED)), tuple(bands))


def sigma_plot(columns: Columns) -> Plot:
    """Return the plot of the standard uncertainty, in its two parts where they are known."""
    parts = (Curve("common", "common part", COMMAND), Curve("random", "random part", AFTER))
    whole = (Curve("sigma", "σ of the angle", AFTER),)
    return Plot("σ, °", parts if "random" in columns.columns else whole, from_zero=True)


def derivative_plots() -> dict[str, Plot]:
    """Return the plots of velocity and acceleration with their uncertainties."""
    return {
        name: Plot(
            f"{name}, {unit}",
            (Curve(name, name, MEASURED),),
            (Band("95 % interval (1.96 σ)", SHADE, f"{name}_sigma", name, NORMAL_95),),
        )
        for name, unit in DERIVATIVES.items()
    }


def derivative_columns(series: AngleSeries) -> dict[str, Floats]:
    """Return velocity and acceleration and their sigmas by name, °/s and °/s²; empty where they are not known."""
    return {} if series.derivatives is None else {k: np.degrees(v) for k, v in vars(series.derivatives).items()}


def series_columns(series: AngleSeries, command: Floats | None = None) -> dict[str, Floats]:
    """Return the columns of a measured series.

    Parameters
    ----------
    series : AngleSeries
        The recording, of n rows.
    command : (n,) ndarray, optional
        The command at each row, rad.

    Returns
    -------
    dict of str to (n,) ndarray
        ``time`` in s, and in degrees ``angle`` and, where there are any, ``sigma``, its parts ``random`` and
        ``common``, ``bound6``, ``bound10``, …, ``command``.
    """
    found = {"time": series.time, "angle": np.degrees(series.angle)}
    if np.isfinite(series.sigma).any():
        found["sigma"] = np.degrees(series.sigma)
    if series.sigma_random is not None:
        found |= {"random": np.degrees(series.sigma_random), "common": np.degrees(series.sigma_common)}
    found |= {f"bound{radius:g}": np.degrees(bound) for radius, bound in series.bounds.items()}
    return found if command is None else found | {"command": np.degrees(command)}


def curves_as_dict(recordings: Sequence[Columns], plots: Mapping[str, Plot]) -> dict[str, Any]:
    """Return the data of a page, as its scripts read it."""
    return {
        "recordings": [
            {
                "name": printable(one.name),
                "first": one.first_frame,
                "columns": {name: _numbers(values) for name, values in one.columns.items()},
            }
            for one in recordings
        ],
        "plots": {name: asdict(plot) for name, plot in plots.items()},
    }


def _numbers(values: Floats) -> list[float | None]:
    return [value if np.isfinite(value) else None for value in np.round(values, DECIMALS).tolist()]
