"""Read HDF5 files as plain data: arrays and texts, nothing pickled and nothing from another file.

HDF5 allows a dataset to be stored in another file and to claim any size. Such datasets are refused.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from anglecam.errors import InputError
from anglecam.io.files import open_regular
from anglecam.io.tracks.tracks import MOST_VALUES

if TYPE_CHECKING:
    import h5py


@contextmanager
def open_hdf5(path: Path) -> Iterator[h5py.File]:
    """Open an HDF5 file; an error that it causes while it is open becomes an `InputError` that names it."""
    import h5py

    try:
        with open_regular(path):  # HDF5 itself would wait for ever at a pipe
            pass
        with h5py.File(path, "r") as file:
            yield file
    except (OSError, RuntimeError, KeyError, ValueError, TypeError, IndexError) as fault:
        if not path.is_file():
            raise InputError(f"{path}: no such file") from fault
        raise InputError(f"{path}: cannot be read as HDF5 ({_reason(fault)})") from fault


def read_array(group: h5py.Group, name: str) -> NDArray[Any]:
    """Read a whole dataset that is stored in this file itself.

    Parameters
    ----------
    group : h5py.Group
        The group that holds it.
    name : str
        Its name in the group.

    Returns
    -------
    ndarray
        The values as they are stored.

    Raises
    ------
    ValueError
        If the dataset is missing, larger than `MOST_VALUES`, or stored outside this file.
    """
    import h5py

    if not isinstance(group.get(name, getlink=True, default=None), h5py.HardLink):
        raise ValueError(f"no {name} in it")
    dataset = group[name]
    if not isinstance(dataset, h5py.Dataset) or dataset.is_virtual or dataset.external or dataset.shape is None:
        raise ValueError(f"{name} is not a dataset of this file")
    if dataset.size * max(dataset.dtype.itemsize // 8, 1) > MOST_VALUES:
        raise ValueError(f"{name} claims {dataset.size:.3g} values, too many for tracks")
    return np.asarray(dataset[()])


def read_texts(group: h5py.Group, name: str) -> tuple[str, ...]:
    """Read a dataset of texts; raises `ValueError` as `read_array` does, and if a value is not text."""
    return tuple(as_text(value) for value in np.atleast_1d(read_array(group, name)).tolist())


def as_text(value: object) -> str:
    """Return a text that is stored as bytes or as a string; raises `ValueError` if it is neither."""
    if isinstance(value, bytes):
        return value.decode("utf-8")
    if isinstance(value, str):
        return value
    raise ValueError(f"a text was expected, found a {type(value).__name__}")


def _reason(fault: Exception) -> str:
    """Return the reason from one of h5py's long messages: the part in brackets."""
    text = str(fault.args[0] if isinstance(fault, KeyError) and fault.args else fault).splitlines()[0]
    _, bracket, rest = text.partition("(")
    return rest.removesuffix(")") if bracket and text.endswith(")") and text.startswith("Unable") else text
