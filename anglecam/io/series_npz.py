"""A measured series kept whole for its session: the table for people is rounded and leaves out what the loop needs."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from anglecam.io.series_csv import AngleSeries

PAIRS = ("picture_px", "marker_px", "own_turn", "lamp_s")


def keep_series(series: AngleSeries, path: Path) -> None:
    """Write a series to the last bit, as NumPy's ``.npz`` without pickled objects."""
    arrays = {
        "name": np.array(series.name),
        "time": series.time,
        "angle": series.angle,
        "sigma": series.sigma,
        "status": np.array(series.status),
        "by_mouth": np.array(series.by_mouth),
        "radii": np.array(list(series.bounds)),
        "bounds": np.array(list(series.bounds.values())),
    }
    for field in ("line", "mouth_px", "pivot_px", *PAIRS, "only_pivot_differs"):
        value = getattr(series, field)
        if value is not None:
            arrays[field] = np.asarray(value)
    with path.open("wb") as stream:
        np.savez(stream, allow_pickle=False, **arrays)


def read_kept(path: Path) -> AngleSeries:
    """Read what `keep_series` wrote.

    Raises
    ------
    OSError
        Where the file is not there.
    """
    with np.load(path, allow_pickle=False) as arrays:
        found = dict(arrays)
    pair = {field: tuple(found[field].tolist()) if field in found else None for field in PAIRS}
    return AngleSeries(
        name=str(found["name"]),
        time=found["time"],
        angle=found["angle"],
        sigma=found["sigma"],
        status=tuple(found["status"].tolist()),
        line=found.get("line"),
        mouth_px=found.get("mouth_px"),
        pivot_px=found.get("pivot_px"),
        bounds=dict(zip(found["radii"].tolist(), found["bounds"], strict=True)),
        by_mouth=bool(found["by_mouth"]),
        only_pivot_differs=bool(found["only_pivot_differs"]) if "only_pivot_differs" in found else None,
        **pair,
    )
