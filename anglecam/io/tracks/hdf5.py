"""HDF5 files read as plain data: arrays and texts, nothing pickled, nothing that lies in another file.

HDF5 lets a dataset live in another file, raw or not, and claim any size. Neither is followed here.
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
    """Open an HDF5 file; whatever goes wrong with it while it is open is an `InputError` that names it."""
    import h5py

    try:
        with open_regular(path):  # HDF5's own opening waits for ever at a pipe
            pass
        with h5py.File(path, "r") as file:
            yield file
    except (OSError, RuntimeError, KeyError, ValueError, TypeError, IndexError) as fault:
        if not path.is_file():
            raise InputError(f"{path}: no such file") from fault
        raise InputError(f"{path}: cannot be read as HDF5 ({_reason(fault)})") from fault


def read_array(group: h5py.Group, name: str) -> NDArray[Any]:
    """Read a whole dataset that lies in this file itself.

    Parameters
    ----------
    group : h5py.Group
        Where it stands.
    name : str
        Its name in there.

    Returns
    -------
    ndarray
        As it is stored.

    Raises
    ------
    ValueError
        Where it is missing, too large, or no dataset of this file.
    """
    import h5py

    if not isinstance(group.get(name, getlink=True, default=None), h5py.HardLink):
        raise ValueError(f"no {name} in it")
    dataset = group[name]
    if not isinstance(dataset, h5py.Dataset) or dataset.is_virtual or dataset.external or dataset.shape is None:
        raise ValueError(f"{name} is no dataset of this file")
    if dataset.size * max(dataset.dtype.itemsize // 8, 1) > MOST_VALUES:
        raise ValueError(f"{name} claims {dataset.size:.3g} values, too many for tracks")
    return np.asarray(dataset[()])


def read_texts(group: h5py.Group, name: str) -> tuple[str, ...]:
    """Read a dataset of texts; raises `ValueError` as `read_array`, and where they are something else."""
    return tuple(as_text(value) for value in np.atleast_1d(read_array(group, name)).tolist())


def as_text(value: object) -> str:
    """Return a stored text, bytes or not; raises `ValueError` where it is neither."""
    if isinstance(value, bytes):
        return value.decode("utf-8")
    if isinstance(value, str):
        return value
    raise ValueError(f"a text was expected, found a {type(value).__name__}")


def _reason(fault: Exception) -> str:
    """Give h5py's own reason, the part in brackets of its long messages."""
    text = str(fault.args[0] if isinstance(fault, KeyError) and fault.args else fault).splitlines()[0]
    _, bracket, rest = text.partition("(")
    return rest.removesuffix(")") if bracket and text.endswith(")") and text.startswith("Unable") else text
