"""DeepLabCut's tables as CSV and as pandas' HDF5: one row for each frame, columns x, y and likelihood of each point.

The header names each column by scorer, individual (only with several animals), body part and coordinate: three or four
rows. In HDF5, pandas writes one of two layouts. Layout ``table``, which DeepLabCut uses, holds the numbers in blocks of
a PyTables table and the names of the columns as a pickled list, which is read without unpickling it
(`anglecam.io.tracks.names_in_pickle`). Layout ``fixed`` holds both as plain arrays. Reading needs neither pandas nor
PyTables.
"""

from __future__ import annotations

import csv
import itertools
import re
from array import array
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats
from anglecam.errors import InputError
from anglecam.io.files import open_text
from anglecam.io.tracks.hdf5 import as_text, read_array, read_texts
from anglecam.io.tracks.names_in_pickle import read_names
from anglecam.io.tracks.tracks import MOST_VALUES, Tracks, unique_in_order
from anglecam.io.tracks.tracks_format import HDF5_ENDINGS, TracksFile, TracksFormat

if TYPE_CHECKING:
    import h5py

_HEADERS = (["scorer", "bodyparts", "coords"], ["scorer", "individuals", "bodyparts", "coords"])
"""First cells of the header rows, with one animal and with several."""
_MOST_BYTES = 20 * MOST_VALUES
"""Size above which a CSV is not read: 20 characters for each value."""
_COORDS = {"x", "y", "likelihood"}
_USUAL_LIMIT = 0.6
"""DeepLabCut's default ``pcutoff``."""
_SHARED = "single"
"""DeepLabCut's name for the individual of points that exist once in the picture, such as a mark on the rig."""
_SPARSEST = 100
"""Largest number of frames for each row; with more, the first column does not hold frame numbers."""
_CLIP_NAME = re.compile(r"(?P<name>.+?)(?:DLC_|DeepCut_|_superanimal_)")
"""DeepLabCut appends its scorer to the clip's name: ``NAMEDLC_resnet50_…shuffle1_50000``."""


def read_csv(path: Path) -> Tracks:
    """Read a DeepLabCut CSV.

    Parameters
    ----------
    path : Path
        The file. Its header rows are scorer, individuals (only with several animals), bodyparts and coords; its first
        column holds the frame number.

    Returns
    -------
    Tracks
        A frame without a row has no points.

    Raises
    ------
    InputError
        If the file is not such a table; the line names the file, the row and the cause.
    """
    try:
        with open_text(path, _MOST_BYTES) as stream:
            rows = (row for row in csv.reader(stream) if any(cell.strip() for cell in row))
            head = list(itertools.islice(rows, 3))
            if len(head) > 1 and head[1][0].strip() == "individuals":
                head += itertools.islice(rows, 1)
            first_cells = [row[0].strip() for row in head]
            if first_cells not in _HEADERS:
                listed = ", ".join(cell[:20] for cell in first_cells) or "nothing"
                raise InputError(
                    f"{path}: not a DeepLabCut table: its rows begin with {listed}, not with scorer, bodyparts, coords"
                )
            table = array("d")
            for number, row in enumerate(itertools.chain(head, rows), start=1):
                if len(row) != len(head[0]):
                    raise InputError(f"{path}: row {number} has {len(row)} cells, the header has {len(head[0])}")
                if number > len(head):
                    table.extend(_number(path, number, cell) for cell in row)
                if len(table) > MOST_VALUES:
                    raise InputError(f"{path}: more than {MOST_VALUES} values are too many for tracks")
    except (OSError, UnicodeDecodeError, csv.Error) as fault:
        reason = fault.strerror if isinstance(fault, OSError) else str(fault).splitlines()[0]
        raise InputError(f"{path}: cannot be read as CSV ({reason})") from fault
    columns = list(zip(*([cell.strip() for cell in row[1:]] for row in head), strict=True))
    values = np.asarray(table).reshape(-1, len(head[0]))
    return _tracks(path, columns, values[:, 0], values[:, 1:])


def read_hdf5(path: Path, group: h5py.Group) -> Tracks:
    """Read a DeepLabCut table from HDF5.

    Parameters
    ----------
    path : Path
        The file, named in messages.
    group : h5py.Group
        The pandas table in it, as `pandas_group` finds it.

    Returns
    -------
    Tracks
        The same as from DeepLabCut's CSV.

    Raises
    ------
    InputError, ValueError
        If the group is not a DeepLabCut table.
    """
    columns, index, values = (_read_table if group.attrs["pandas_type"] == b"frame_table" else _read_fixed)(group)
    if index.dtype.kind not in "iu":
        raise InputError(f"{path}: its rows are not numbered frames of a clip")
    return _tracks(path, columns, index, values)


def pandas_group(file: h5py.File) -> h5py.Group | None:
    """Return the first group of a file that holds a table of pandas, ``None`` if there is none."""
    import h5py

    for name in file:
        if isinstance(file.get(name, getlink=True), h5py.HardLink):
            group = file[name]
            if isinstance(group, h5py.Group) and group.attrs.get("pandas_type") in (b"frame_table", b"frame"):
                return group
    return None


def _read_table(group: h5py.Group) -> tuple[list[tuple[str, ...]], NDArray, Floats]:
    table = read_array(group, "table")
    attributes = group["table"].attrs
    blocks = [name for name in table.dtype.names or () if re.fullmatch(r"values_block_\d+", name)]
    if not blocks or "index" not in (table.dtype.names or ()):
        raise ValueError("its table has no blocks of values")
    columns: list[tuple[str, ...]] = []
    for block in blocks:
        columns += read_names(bytes(attributes[f"{block}_kind"]))
    return columns, table["index"], _joined([table[block] for block in blocks])


def _read_fixed(group: h5py.Group) -> tuple[list[tuple[str, ...]], NDArray, Floats]:
    columns: list[tuple[str, ...]] = []
    blocks = []
    for i in range(int(group.attrs["nblocks"])):
        parts = []
        for level in range(int(group.attrs[f"block{i}_items_nlevels"])):
            names = read_texts(group, f"block{i}_items_level{level}")
            parts.append([names[code] for code in read_array(group, f"block{i}_items_label{level}")])
        columns += list(zip(*parts, strict=True))
        blocks.append(read_array(group, f"block{i}_values"))
    return columns, read_array(group, "axis1"), _joined(blocks)


def _joined(blocks: Sequence[NDArray]) -> Floats:
    if not blocks or any(block.ndim != 2 or block.dtype.kind not in "fiu" for block in blocks):
        raise ValueError("its blocks are not tables of numbers")
    return np.hstack(blocks).astype(float, copy=False)


def _tracks(path: Path, columns: Sequence[Sequence[str]], index: NDArray, values: Floats) -> Tracks:
    """Arrange the columns of a table by individual, point and coordinate, and its rows by frame.

    A point of the individual `_SHARED` is copied to every individual that has no point of that name.
    """
    depth = {len(column) for column in columns}
    if len(depth) != 1 or not depth <= {3, 4} or values.shape != (len(index), len(columns)):
        raise InputError(f"{path}: not a DeepLabCut table: its columns are not scorer, bodyparts, coords")
    names = [(as_text(c[1]) if len(c) == 4 else "", as_text(c[-2]), as_text(c[-1])) for c in columns]
    unknown = {coord for *_, coord in names} - _COORDS
    if unknown or len(set(names)) != len(names):
        problem = f"coordinate {min(unknown)!r} in it" if unknown else "a point twice in it"
        raise InputError(f"{path}: {problem}; a DeepLabCut table of one clip has x, y and likelihood of each point")
    frames = _frame_numbers(path, index)
    individuals, keypoints = (unique_in_order([name[k] for name in names]) for k in (0, 1))
    n = int(frames[-1]) + 1
    if n * len(individuals) * len(keypoints) * 3 > MOST_VALUES:
        raise InputError(f"{path}: {n} frames of {len(individuals) * len(keypoints)} points are too many for tracks")
    values_of = np.full((n, len(individuals), len(keypoints), 3), np.nan)
    shared = {point for owner, point, _ in names if owner == _SHARED} - {n[1] for n in names if n[0] != _SHARED}
    for (individual, keypoint, coord), column in zip(names, values.T, strict=True):
        k = ("x", "y", "likelihood").index(coord)
        for i in range(len(individuals)) if keypoint in shared else [individuals.index(individual)]:
            values_of[frames, i, keypoints.index(keypoint), k] = column
    return Tracks(path, individuals, keypoints, values_of[..., :2], values_of[..., 2])


def _frame_numbers(path: Path, index: NDArray) -> NDArray[np.intp]:
    if len(index) == 0:
        raise InputError(f"{path}: a header but no rows")
    whole = np.isfinite(index) & (np.asarray(index) >= 0) & (np.asarray(index) < 1000 + _SPARSEST * len(index))
    if not whole.all() or (np.asarray(index) % 1 != 0).any() or (np.diff(index) <= 0).any():
        raise InputError(f"{path}: its first column does not number the frames of a clip (0, 1, 2 …)")
    return np.asarray(index).astype(np.intp)


def _number(path: Path, row: int, cell: str) -> float:
    try:
        return float(cell) if cell.strip() else np.nan
    except ValueError:
        raise InputError(f"{path}: row {row}: {cell[:40]!r} is not a number") from None


def _recognises(file: TracksFile) -> bool:
    return pandas_group(file.hdf5) is not None if file.is_hdf5 else file.first_line.startswith("scorer,")


def _read(file: TracksFile) -> Tracks:
    if not file.is_hdf5:
        return read_csv(file.path)
    group = pandas_group(file.hdf5)
    if group is None:
        raise InputError(f"{file.path}: not a DeepLabCut table ({file.content()})")
    return read_hdf5(file.path, group)


def _clip_name(stem: str) -> str | None:
    found = _CLIP_NAME.match(stem)
    return found["name"] if found else None


FORMAT = TracksFormat(
    program="DeepLabCut",
    kind="table",
    endings=(".csv", *HDF5_ENDINGS),
    recognises=_recognises,
    read=_read,
    clip_name=_clip_name,
    usual_limit=_USUAL_LIMIT,
    companions=("_skeleton",),  # the lengths of bones
)
