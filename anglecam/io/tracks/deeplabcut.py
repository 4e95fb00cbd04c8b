"""DeepLabCut's tables: points × (x, y, likelihood) as columns, a row a frame; as CSV and as pandas' HDF5.

The header names each column by scorer, (individual,) body part and coordinate: three rows, four with several animals.
In HDF5 pandas writes one of two layouts. ``table``, DeepLabCut's own choice, has the numbers in blocks of a PyTables
table and the columns' names as a pickled list, which is read without loading it (`anglecam.io.tracks.names_in_pickle`);
``fixed`` has both as plain arrays. Neither needs pandas or PyTables.
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

if TYPE_CHECKING:
    import h5py


_HEADERS = (["scorer", "bodyparts", "coords"], ["scorer", "individuals", "bodyparts", "coords"])
_MOST_BYTES = 20 * MOST_VALUES
_COORDS = {"x", "y", "likelihood"}
_USUAL_LIMIT = 0.6
"""DeepLabCut's own ``pcutoff``."""
_SHARED = "single"
"""What DeepLabCut calls the individual of points that exist once in the picture, such as a mark on the rig."""
_SPARSEST = 100
"""Frames for each row beyond which its numbers count something else."""


def read_csv(path: Path) -> Tracks:
    """Read a DeepLabCut CSV.

    Parameters
    ----------
    path : Path
        With the header rows scorer, (individuals,) bodyparts, coords; the first column holds the frame's number.

    Returns
    -------
    Tracks
        A frame whose row is missing has no points.

    Raises
    ------
    InputError
        Where it is none of that: one line with the file, the row and the cause.
    """
    try:
        with open_text(path, _MOST_BYTES) as stream:
            rows = (row for row in csv.reader(stream) if any(cell.strip() for cell in row))
            head = list(itertools.islice(rows, 3))
            if len(head) > 1 and head[1][0].strip() == "individuals":
                head += itertools.islice(rows, 1)
            begins = [row[0].strip() for row in head]
            if begins not in _HEADERS:
                said = ", ".join(cell[:20] for cell in begins) or "nothing"
                raise InputError(
                    f"{path}: not a DeepLabCut table: its rows begin with {said}, not with scorer, bodyparts, coords"
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
    """Read a DeepLabCut table from HDF5; raises `InputError` or `ValueError` where it is not one.

    Parameters
    ----------
    path : Path
        The file, for messages.
    group : h5py.Group
        Of pandas, as `pandas_group` finds it.

    Returns
    -------
    Tracks
        As of the CSV.
    """
    columns, index, values = (_read_table if group.attrs["pandas_type"] == b"frame_table" else _read_fixed)(group)
    if index.dtype.kind not in "iu":
        raise InputError(f"{path}: its rows are not numbered frames of a film")
    return _tracks(path, columns, index, values)


def pandas_group(file: h5py.File) -> h5py.Group | None:
    """Return the first group of a file in which pandas has put a table, ``None`` if there is none."""
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
        raise ValueError("no blocks of values in its table")
    columns: list[tuple[str, ...]] = []
    for block in blocks:
        columns += read_names(bytes(attributes[f"{block}_kind"]))
    return columns, table["index"], _side_by_side([table[block] for block in blocks])


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
    return columns, read_array(group, "axis1"), _side_by_side(blocks)


def _side_by_side(blocks: Sequence[NDArray]) -> Floats:
    if not blocks or any(block.ndim != 2 or block.dtype.kind not in "fiu" for block in blocks):
        raise ValueError("its blocks are not tables of numbers")
    return np.hstack(blocks).astype(float, copy=False)


def _tracks(path: Path, columns: Sequence[Sequence[str]], index: NDArray, values: Floats) -> Tracks:
    """Sort the columns of a table by individual, point and coordinate, and its rows by frame."""
    depth = {len(column) for column in columns}
    if len(depth) != 1 or not depth <= {3, 4} or values.shape != (len(index), len(columns)):
        raise InputError(f"{path}: not a DeepLabCut table: its columns are not scorer, bodyparts, coords")
    names = [(as_text(c[1]) if len(c) == 4 else "", as_text(c[-2]), as_text(c[-1])) for c in columns]
    strange = {coord for *_, coord in names} - _COORDS
    if strange or len(set(names)) != len(names):
        said = f"coordinate {min(strange)!r}" if strange else "a point twice"
        raise InputError(f"{path}: {said} in it; a DeepLabCut table of one film has x, y and likelihood of each point")
    frames = _frame_numbers(path, index)
    individuals, keypoints = (unique_in_order([name[k] for name in names]) for k in (0, 1))
    n = int(frames[-1]) + 1
    if n * len(individuals) * len(keypoints) * 3 > MOST_VALUES:
        raise InputError(f"{path}: {n} frames of {len(individuals) * len(keypoints)} points are too many for tracks")
    sorted_out = np.full((n, len(individuals), len(keypoints), 3), np.nan)
    common = {point for owner, point, _ in names if owner == _SHARED} - {n[1] for n in names if n[0] != _SHARED}
    for (individual, keypoint, coord), column in zip(names, values.T, strict=True):
        k = ("x", "y", "likelihood").index(coord)
        for i in range(len(individuals)) if keypoint in common else [individuals.index(individual)]:
            sorted_out[frames, i, keypoints.index(keypoint), k] = column
    return Tracks(
        path, "DeepLabCut", individuals, keypoints, sorted_out[..., :2], sorted_out[..., 2], usual_limit=_USUAL_LIMIT
    )


def _frame_numbers(path: Path, index: NDArray) -> NDArray[np.intp]:
    if len(index) == 0:
        raise InputError(f"{path}: a header but no rows")
    whole = np.isfinite(index) & (np.asarray(index) >= 0) & (np.asarray(index) < 1000 + _SPARSEST * len(index))
    if not whole.all() or (np.asarray(index) % 1 != 0).any() or (np.diff(index) <= 0).any():
        raise InputError(f"{path}: its first column does not number the frames of a film (0, 1, 2 …)")
    return np.asarray(index).astype(np.intp)


def _number(path: Path, row: int, cell: str) -> float:
    try:
        return float(cell) if cell.strip() else np.nan
    except ValueError:
        raise InputError(f"{path}: row {row}: {cell[:40]!r} is not a number") from None
