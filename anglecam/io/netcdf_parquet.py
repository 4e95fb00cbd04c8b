"""Angle series for other programs: netCDF in the layout of `movement`, and Parquet tables.

`movement` (neuroinformatics.dev) holds poses as an xarray dataset: ``position`` over time, space, keypoints and
individuals, ``confidence`` over the same without space, and attributes that state the source. The mark (keypoint
``mouth``) and the pivot are the two keypoints; the angle and its uncertainty are further variables over time.

The netCDF file also holds the series unrounded, so that `read_netcdf` returns it bit for bit.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import fields
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import anglecam
from anglecam.data.camera_evidence import CameraEvidence
from anglecam.data.derivatives import Derivatives
from anglecam.data.series import AngleSeries
from anglecam.data.tables import unit_of
from anglecam.errors import InputError, printable
from anglecam.io.files import write_whole

GROUP = "anglecam"
"""Group of the netCDF file that holds the fields of the series unrounded."""


class Also(StrEnum):
    """Formats that `write_also` can write in addition to the CSV."""

    netcdf = "netcdf"
    parquet = "parquet"


def write_also(series: AngleSeries, formats: Iterable[Also], stem: Path) -> None:
    """Write a series as ``NAME.angles.nc``, ``NAME.angles.parquet`` or both.

    Parameters
    ----------
    series : AngleSeries
        A measured series.
    formats : iterable of Also
        Formats to write; one that is listed twice is written once.
    stem : Path
        The folder and NAME.
    """
    for wanted in dict.fromkeys(formats):
        if wanted is Also.netcdf:
            write_netcdf(series, stem.with_name(f"{stem.name}.angles.nc"))
        else:
            write_parquet(series, stem.with_name(f"{stem.name}.angles.parquet"))


def write_netcdf(series: AngleSeries, path: Path) -> None:
    """Write a series as netCDF-4: in the layout of `movement`'s poses, and unrounded in a separate group.

    The dimensions are time, space, keypoints and individuals. ``position`` is in px; ``confidence`` is NaN, because
    anglecam states an uncertainty and no likelihood. ``angle_deg``, ``sigma_deg``, ``line_deg``, the bounds and
    ``status`` are variables over time, and so are velocity and acceleration. The group ``anglecam`` holds the fields
    of `AngleSeries` and `CameraEvidence` in rad, s and px, unrounded.

    Parameters
    ----------
    series : AngleSeries
        A measured series; without marks the positions are NaN.
    path : Path
        The file; it is written whole or not at all. Equal series give equal bytes.
    """
    import h5netcdf

    columns = series.columns()
    n = len(series.time)
    with write_whole(path) as unfinished, h5netcdf.File(unfinished, "w") as file:
        file.dimensions = {"time": n, "space": 2, "keypoints": 2, "individuals": 1}
        file.attrs.update(
            {
                "source_software": "anglecam",
                "source_software_version": anglecam.__version__,
                "source_file": printable(series.name),
                "ds_type": "poses",
                "time_unit": "seconds",
                "fps": _rate_hz(series.time),
            }
        )
        time = file.create_variable("time", ("time",), "f8", data=series.time)
        time.attrs["long_name"] = "time stamps of the frames on the clip's own clock, in seconds"
        for name, labels in (("space", ["x", "y"]), ("keypoints", ["mouth", "pivot"]), ("individuals", ["head"])):
            _texts(file, name, name, labels)
        points = np.stack([_points(series.mark_px, n), _points(series.pivot_px, n)], axis=-1)
        position = file.create_variable("position", tuple(file.dimensions), "f8", data=points[..., None])
        position.attrs["units"] = "pixel"
        unstated = np.full((n, 2, 1), np.nan)
        file.create_variable("confidence", ("time", "keypoints", "individuals"), "f8", data=unstated)
        for name, values in columns.items():
            if "_deg" in name:
                variable = file.create_variable(name, ("time",), "f8", data=values)
                variable.attrs["units"] = unit_of(name)
        _texts(file, "status", "time", series.status)
        _write_exact(file.create_group(GROUP), series)


def read_netcdf(path: Path) -> AngleSeries:
    """Read a series that `write_netcdf` wrote; the result equals what was written bit for bit.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    AngleSeries
        The series with its `CameraEvidence`.

    Raises
    ------
    OSError
        If the file is missing or is not netCDF-4.
    InputError
        If another program wrote it.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> time = np.arange(3) / 30.0
    >>> series = AngleSeries("nod", time, np.sin(time), np.full(3, 1e-4), ("ok", "ok", "ok"))
    >>> with TemporaryDirectory() as folder:
    ...     write_netcdf(series, Path(folder, "nod.angles.nc"))
    ...     back = read_netcdf(Path(folder, "nod.angles.nc"))
    >>> np.array_equal(back.angle, series.angle)
    True
    """
    import h5netcdf

    with h5netcdf.File(path, "r") as file:
        if GROUP not in file.groups:
            raise InputError(f"{path}: not an angle series of anglecam")
        group = file.groups[GROUP]
        exact = {name: np.asarray(variable[...]) for name, variable in group.variables.items()}
        stated = {name: np.asarray(value) for name, value in group.attrs.items()}
        status = tuple(text.decode() if isinstance(text, bytes) else text for text in file.variables["status"][...])
    evidence = CameraEvidence(**{f.name: _from_attribute(stated.get(f.name)) for f in fields(CameraEvidence)})
    rates = {field.name: exact[field.name] for field in fields(Derivatives) if field.name in exact}
    return AngleSeries(
        name=os.fsdecode(stated["name"].tobytes()),
        time=exact["time"],
        angle=exact["angle"],
        sigma=exact["sigma"],
        status=status,
        line=exact.get("line"),
        mark_px=exact.get("mark_px"),
        pivot_px=exact.get("pivot_px"),
        bounds={float(r): exact["bounds"][i] for i, r in enumerate(exact["radius"])},
        first_frame=int(stated.get("first_frame", 0)),
        sigma_random=exact.get("sigma_random"),
        derivatives=Derivatives(**rates) if len(rates) == len(fields(Derivatives)) else None,
        evidence=evidence,
    )


def _write_exact(group: Any, series: AngleSeries) -> None:
    """Write the fields of a series and of its evidence unchanged; a field that is ``None`` is left out."""
    group.dimensions = {"radius": len(series.bounds)}
    group.create_variable("radius", ("radius",), "f8", data=np.array(list(series.bounds)))
    bounds = np.array(list(series.bounds.values())).reshape(len(series.bounds), len(series.time))
    group.create_variable("bounds", ("radius", "time"), "f8", data=bounds)
    over_time = {name: getattr(series, name) for name in ("time", "angle", "sigma", "line", "sigma_random")}
    if series.derivatives is not None:
        over_time |= vars(series.derivatives)
    for name, values in over_time.items():
        if values is not None:
            group.create_variable(name, ("time",), "f8", data=values)
    for name in ("mark_px", "pivot_px"):
        if getattr(series, name) is not None:
            group.create_variable(name, ("time", "space"), "f8", data=getattr(series, name))
    group.attrs["first_frame"] = np.int64(series.first_frame)
    group.attrs["name"] = np.frombuffer(os.fsencode(series.name), np.uint8)  # a file's name need not be valid text
    for field in fields(series.evidence):
        value = getattr(series.evidence, field.name)
        if value is not None:
            group.attrs[field.name] = np.asarray(value, dtype=np.int64 if _is_whole(value) else np.float64)


def _is_whole(value: Any) -> bool:
    return isinstance(value, bool) or (isinstance(value, tuple) and all(isinstance(part, int) for part in value))


def _from_attribute(value: NDArray | None) -> Any:
    """Return the flag or the pair that `_write_exact` stored as an attribute."""
    if value is None:
        return None
    return tuple(value.tolist()) if value.size == 2 else bool(value)


def write_parquet(series: AngleSeries, path: Path) -> None:
    """Write a series as Parquet with the columns of the CSV and their units in the schema.

    Parameters
    ----------
    series : AngleSeries
        A measured series; cells that are empty in the CSV are null.
    path : Path
        The file; it is written whole or not at all.
    """
    import pyarrow as pa
    from pyarrow import parquet

    schema, arrays = [], []
    for name, values in series.columns().items():
        unit = unit_of(name)
        array = pa.array(values, from_pandas=True)  # NaN becomes null
        schema.append(pa.field(name, array.type, metadata=None if unit is None else {"unit": unit}))
        arrays.append(array)
    metadata = {"source_software": f"anglecam {anglecam.__version__}", "name": printable(series.name)}
    with write_whole(path) as unfinished, unfinished.open("wb") as stream:  # pyarrow would read a name as an address
        parquet.write_table(pa.Table.from_arrays(arrays, schema=pa.schema(schema, metadata=metadata)), stream)


def _points(points_px: NDArray[np.float64] | None, n: int) -> NDArray[np.float64]:
    return np.full((n, 2), np.nan) if points_px is None else points_px


def _rate_hz(time: NDArray[np.float64]) -> float:
    """Return the frame rate from the median interval, Hz; it is nominal, and ``time`` holds the exact times."""
    return 1.0 / float(np.median(np.diff(time))) if len(time) > 1 else float("nan")


def _texts(file: Any, name: str, dimension: str, texts: Iterable[str]) -> None:
    import h5py

    values = np.array(list(texts), dtype=object)
    file.create_variable(name, (dimension,), h5py.string_dtype(), data=values)
