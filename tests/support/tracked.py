"""Files of tracked points in the layouts of DeepLabCut and SLEAP, made from known points.

The layouts are those of the programs' writers: pandas' ``to_csv`` and ``to_hdf`` (DeepLabCut), and
``sleap/info/write_tracking_h5.py`` (SLEAP), whose arrays are transposed.
"""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pandas as pd

SCORER = "DLC_resnet50_nodJan1shuffle1_50000"
PIVOT = np.array([210.0, 300.0])
LEVER = 180.0


def nod(angle_deg: np.ndarray, rng: np.random.Generator, *, sigma_px: float = 0.3) -> np.ndarray:
    """Return (frames, 2, 2) px, nose and neck of a head that faces right and is turned up by ``angle_deg``."""
    angle = np.radians(angle_deg)
    mouth = PIVOT + LEVER * np.column_stack([np.cos(angle), -np.sin(angle)])
    points = np.stack([mouth, np.broadcast_to(PIVOT, mouth.shape)], axis=1)
    return points + sigma_px * rng.standard_normal(points.shape)


def frame(points: np.ndarray, likelihood: np.ndarray, names=("nose", "neck"), individuals=None) -> pd.DataFrame:
    """Return DeepLabCut's table of points (frames, individuals, points, 2); without ``individuals``, for one animal."""
    levels = [[SCORER], list(names), ["x", "y", "likelihood"]]
    labels = ["scorer", "bodyparts", "coords"]
    if individuals is not None:
        levels.insert(1, list(individuals))
        labels.insert(1, "individuals")
    columns = pd.MultiIndex.from_product(levels, names=labels)
    values = np.concatenate([points, likelihood[..., None]], axis=-1)
    return pd.DataFrame(values.reshape(len(points), -1), columns=columns)


def write_deeplabcut(path: Path, points: np.ndarray, likelihood=None, *, layout: str = "table", **more) -> Path:
    """Write a table as DeepLabCut does, CSV or HDF5 by the file's ending."""
    points = points if points.ndim == 4 else points[:, None]
    likelihood = np.full(points.shape[:3], 0.99) if likelihood is None else likelihood.reshape(points.shape[:3])
    table = frame(points, likelihood, **more)
    if path.suffix == ".csv":
        table.to_csv(path)
    else:
        table.to_hdf(path, key="df_with_missing", format=layout, mode="w")
    return path


def write_sleap(path: Path, points: np.ndarray, scores=None, names=("nose", "neck"), tracks=("track_0",)) -> Path:
    """Write points (frames, tracks, nodes, 2) as SLEAP's analysis file, transposed as SLEAP does."""
    points = points if points.ndim == 4 else points[:, None]
    scores = np.full(points.shape[:3], 0.8) if scores is None else scores
    there = np.isfinite(points).any(axis=(2, 3))
    with h5py.File(path, "w") as file:
        file["track_names"] = [np.bytes_(name) for name in tracks]
        file["node_names"] = [np.bytes_(name) for name in names]
        whole = {
            "tracks": points.transpose(0, 2, 3, 1),
            "track_occupancy": there.T.astype(np.uint8),
            "point_scores": scores.transpose(0, 2, 1),
            "instance_scores": scores.mean(axis=2),
            "tracking_scores": np.zeros(there.shape),
        }
        for name, values in whole.items():
            file.create_dataset(name, data=values.T, compression="gzip", compression_opts=9)
    return path
