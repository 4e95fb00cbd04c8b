"""Tables of results for notebooks: pandas, xarray and HTML.

pandas and xarray are optional. They are imported when a table is asked for, and only here.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from anglecam.data.typing import Floats

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

Variables = Mapping[str, tuple[Sequence[str], Any]]
"""Dimensions and values of each variable, by its name."""


def pandas_table(columns: Mapping[str, Any], index: str) -> pd.DataFrame:
    """Return columns as a pandas table.

    Parameters
    ----------
    columns : mapping
        (n,) values by name; a name of a quantity ends in its unit.
    index : str
        Name of the column that becomes the index.

    Returns
    -------
    pandas.DataFrame
        n rows.

    Raises
    ------
    ImportError
        If pandas is not installed.
    """
    table: pd.DataFrame = _load("pandas").DataFrame(dict(columns))
    return table.set_index(index)


def xarray_dataset(variables: Variables, coordinates: Variables, attributes: Mapping[str, Any]) -> xr.Dataset:
    """Return variables as an xarray dataset; a variable whose name ends in a unit has it as its attribute ``units``.

    Raises
    ------
    ImportError
        If xarray is not installed.
    """
    with_units = {
        name: (dims, values, {"units": unit} if (unit := unit_of(name)) else {})
        for name, (dims, values) in variables.items()
    }
    dataset: xr.Dataset = _load("xarray").Dataset(with_units, dict(coordinates), dict(attributes))
    return dataset


_UNITS = {"deg_s2": "degree/s^2", "deg_s": "degree/s", "deg": "degree", "px": "pixel", "s": "s"}
"""Units by the end of a column's name; an end that another one ends in comes later."""


def unit_of(column: str) -> str | None:
    """Return the unit that the name of a column ends in, ``None`` where it ends in none.

    Examples
    --------
    >>> unit_of("velocity_deg_s"), unit_of("time_s"), unit_of("status")
    ('degree/s', 's', None)
    """
    return next((unit for end, unit in _UNITS.items() if column.endswith(f"_{end}")), None)


def _load(library: str) -> Any:
    try:
        return import_module(library)
    except ImportError as missing:
        raise ImportError(
            f"{library} is needed for this table and is not installed: {sys.executable} -m pip install {library}"
        ) from missing


def html_table(title: str, header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a titled table as HTML for a notebook; all texts are escaped."""
    head = "".join(f"<th>{escape(cell)}</th>" for cell in header)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    caption = f'<caption style="text-align:left;font-weight:bold">{escape(title)}</caption>'
    return f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def html_curve(time: Floats, values: Floats, label: str) -> str:
    """Return a curve over time as a small SVG picture; frames without a value leave a gap.

    Parameters
    ----------
    time : (n,) ndarray
        s.
    values : (n,) ndarray
        In any unit; NaN where nothing was measured.
    label : str
        Description for people who cannot see the picture.

    Returns
    -------
    str
        SVG of 480 × 120 px. Of many frames, the smallest and the largest value of each pixel column are drawn.
    """
    measured = np.isfinite(values)
    if np.sum(measured) < 2:
        return ""
    low, high = np.min(values[measured]), np.max(values[measured])
    x = (time - time[0]) / max(time[-1] - time[0], 1e-12) * 478.0 + 1.0
    y = 119.0 - (values - low) / max(high - low, 1e-12) * 118.0
    kept = _extremes(x, y)
    steps = [
        f"{'L' if drawn else 'M'}{x[k]:.1f} {y[k]:.1f}" for k, drawn in zip(kept, _joined(kept, measured), strict=True)
    ]
    return (
        f'<svg role="img" aria-label="{escape(label)}" width="480" height="120" viewBox="0 0 480 120">'
        f'<path d="{"".join(steps)}" fill="none" stroke="currentColor"/></svg>'
    )


def _extremes(x: Floats, y: Floats) -> list[int]:
    """Return the frames with the smallest and the largest value of each pixel column, in order."""
    measured = np.flatnonzero(np.isfinite(y))
    columns = np.split(measured, np.flatnonzero(np.diff(x[measured].astype(int))) + 1)
    return sorted({int(column[pick(y[column])]) for column in columns for pick in (np.argmin, np.argmax)})


def _joined(kept: Sequence[int], measured: Any) -> list[bool]:
    """Return for each kept frame whether a line leads to it: not where a frame in between was not measured."""
    gaps = np.cumsum(~measured)
    return [k > 0 and gaps[frame] == gaps[kept[k - 1]] for k, frame in enumerate(kept)]
