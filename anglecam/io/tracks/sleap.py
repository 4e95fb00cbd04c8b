"""SLEAP's analysis files: HDF5 with dense arrays of tracks.

SLEAP writes its arrays transposed, for MATLAB: ``tracks`` is (tracks, 2, nodes, frames), ``point_scores`` is (tracks,
nodes, frames). Newer versions state the order of the axes in an attribute ``dims`` and allow other orders. Older
versions could leave the arrays untransposed, (frames, nodes, 2, tracks), which the shapes show. ``instance_scores``,
``tracking_scores`` and ``track_occupancy`` do not describe single points and are not read. Frames are counted from the
first of the clip, as SLEAP writes them unless its option to leave out the empty frames before the first label is set;
the file does not state whether it was.

Layout: ``sleap/info/write_tracking_h5.py`` of SLEAP 1.x and ``sleap_io/io/analysis_h5.py`` of sleap-io 0.6.
"""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING

import numpy as np

from anglecam.errors import InputError
from anglecam.io.tracks.hdf5 import as_text, read_array, read_texts
from anglecam.io.tracks.tracks import Tracks
from anglecam.io.tracks.tracks_format import HDF5_ENDINGS, TracksFile, TracksFormat

if TYPE_CHECKING:
    import h5py

_WANTED = ("frame", "track", "node", "xy")
"""Order of the axes of `Tracks.position_px`."""
_MATLAB = ("track", "xy", "node", "frame")
_UNTRANSPOSED = ("frame", "node", "xy", "track")
_USUAL_LIMIT = 0.2
"""SLEAP's default ``peak_threshold``."""
_CLIP_NAME = re.compile(r"(?:.*\.\d{3}_)?(?P<name>.+)\.analysis")
"""SLEAP names its files ``PROJECT.000_NAME.analysis.h5``."""


def is_analysis(file: h5py.File) -> bool:
    """Return whether an HDF5 file is a SLEAP analysis file."""
    return "tracks" in file and "node_names" in file


def read_analysis(source: TracksFile) -> Tracks:
    """Read a SLEAP analysis file.

    Parameters
    ----------
    source : TracksFile
        The file.

    Returns
    -------
    Tracks
        Each track is an individual.

    Raises
    ------
    InputError, ValueError
        If arrays are missing or their shapes do not fit each other.
    """
    path, file = source.path, source.hdf5
    nodes = read_texts(file, "node_names")
    names = read_texts(file, "track_names") if "track_names" in file else ()
    points = read_array(file, "tracks")
    order = _order(file["tracks"], points.shape, len(nodes), max(len(names), 1))
    if order is None:
        shape = "×".join(map(str, points.shape))
        raise InputError(f"{path}: tracks of {shape} values do not fit {len(nodes)} nodes and {len(names)} tracks")
    points = points.transpose([order.index(axis) for axis in _WANTED]).astype(float, copy=False)
    likelihood = np.full(points.shape[:3], np.nan)
    if "point_scores" in file:
        without_xy = [axis for axis in order if axis != "xy"]
        scores = read_array(file, "point_scores").transpose([without_xy.index(axis) for axis in _WANTED[:3]])
        if scores.shape != points.shape[:3]:
            raise InputError(f"{path}: point_scores and tracks differ in shape")
        likelihood = scores.astype(float, copy=False)
    individuals = names or ("",)
    return Tracks(path, individuals, nodes, points, likelihood)


def _order(dataset: h5py.Dataset, shape: tuple[int, ...], nodes: int, tracks: int) -> tuple[str, ...] | None:
    """Return the names of the axes, from ``dims`` if the file has it, else from the shape; ``None`` if none fits."""
    stated = tuple(json.loads(as_text(dataset.attrs["dims"]))) if "dims" in dataset.attrs else None
    length = {"node": nodes, "track": tracks, "xy": 2}
    for order in (_MATLAB, _UNTRANSPOSED) if stated is None else (stated,):
        if sorted(order) == sorted(_WANTED) and len(shape) == 4:
            sizes = dict(zip(order, shape, strict=True))
            if sizes["frame"] > 0 and all(sizes[axis] == n for axis, n in length.items()):
                return order
    return None


def _clip_name(stem: str) -> str | None:
    found = _CLIP_NAME.fullmatch(stem)
    return found["name"] if found else None


FORMAT = TracksFormat(
    program="SLEAP",
    kind="analysis file",
    endings=HDF5_ENDINGS,
    recognises=lambda file: is_analysis(file.hdf5),
    read=read_analysis,
    clip_name=_clip_name,
    usual_limit=_USUAL_LIMIT,
)
