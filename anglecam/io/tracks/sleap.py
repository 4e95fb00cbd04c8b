"""SLEAP's analysis files: HDF5 with dense arrays of tracks.

SLEAP writes its arrays transposed, for MATLAB: ``tracks`` is (tracks, 2, nodes, frames), ``point_scores`` is (tracks,
nodes, frames). Newer versions say so in an attribute ``dims`` and know other orders; older ones could leave them
untransposed, (frames, nodes, 2, tracks), which the shapes tell. ``instance_scores``, ``tracking_scores`` and
``track_occupancy`` say nothing of single points and are not needed. Frames are counted from the film's first, as the
programs write them unless told to leave out the empty ones before the first label, which the file then does not say.

Layout: ``sleap/info/write_tracking_h5.py`` of SLEAP 1.x and ``sleap_io/io/analysis_h5.py`` of sleap-io 0.6.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from anglecam.errors import InputError
from anglecam.io.tracks.hdf5 import as_text, read_array, read_texts
from anglecam.io.tracks.tracks import Tracks

if TYPE_CHECKING:
    import h5py

_WANTED = ("frame", "track", "node", "xy")
_MATLAB = ("track", "xy", "node", "frame")
_UNTRANSPOSED = ("frame", "node", "xy", "track")
_USUAL_LIMIT = 0.2
"""SLEAP's own ``peak_threshold``."""


def is_analysis(file: h5py.File) -> bool:
    """Tell whether an HDF5 file is a SLEAP analysis file."""
    return "tracks" in file and "node_names" in file


def read_analysis(path: Path, file: h5py.File) -> Tracks:
    """Read a SLEAP analysis file.

    Parameters
    ----------
    path : Path
        The file, for messages.
    file : h5py.File
        Open.

    Returns
    -------
    Tracks
        Each track is an individual.

    Raises
    ------
    InputError, ValueError
        Where the arrays do not belong together, or are missing.
    """
    nodes = read_texts(file, "node_names")
    names = read_texts(file, "track_names") if "track_names" in file else ()
    places = read_array(file, "tracks")
    order = _order(file["tracks"], places.shape, len(nodes), max(len(names), 1))
    if order is None:
        shape = "×".join(map(str, places.shape))
        raise InputError(f"{path}: tracks of {shape} values do not fit {len(nodes)} nodes and {len(names)} tracks")
    places = places.transpose([order.index(axis) for axis in _WANTED]).astype(float, copy=False)
    likelihood = np.full(places.shape[:3], np.nan)
    if "point_scores" in file:
        without_xy = [axis for axis in order if axis != "xy"]
        scores = read_array(file, "point_scores").transpose([without_xy.index(axis) for axis in _WANTED[:3]])
        if scores.shape != places.shape[:3]:
            raise InputError(f"{path}: point_scores do not fit tracks")
        likelihood = scores.astype(float, copy=False)
    individuals = names or ("",)
    return Tracks(path, "SLEAP", individuals, nodes, places, likelihood, usual_limit=_USUAL_LIMIT)


def _order(dataset: h5py.Dataset, shape: tuple[int, ...], nodes: int, tracks: int) -> tuple[str, ...] | None:
    """Say which axis is which, by what the file says or else by the shapes; ``None`` where nothing fits."""
    said = tuple(json.loads(as_text(dataset.attrs["dims"]))) if "dims" in dataset.attrs else None
    length = {"node": nodes, "track": tracks, "xy": 2}
    for order in (_MATLAB, _UNTRANSPOSED) if said is None else (said,):
        if sorted(order) == sorted(_WANTED) and len(shape) == 4:
            sizes = dict(zip(order, shape, strict=True))
            if sizes["frame"] > 0 and all(sizes[axis] == n for axis, n in length.items()):
                return order
    return None
