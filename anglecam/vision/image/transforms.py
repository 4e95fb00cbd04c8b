"""Rigid motions in the plane of the picture: a turn and a shift, as a 3 × 3 matrix of homogeneous coordinates.

Turns count counter-clockwise as seen, though y points down.
"""

from __future__ import annotations

import numpy as np

from anglecam.data.typing import Floats


def rotation(turns: float | Floats) -> Floats:
    """Give the matrices (…, 2, 2) that turn rows of points: v @ M is v turned counter-clockwise as seen, y down.

    Parameters
    ----------
    turns : float or ndarray
        (…) rad.
    """
    c, s = np.cos(turns), np.sin(turns)
    return np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=-2)


def fit_rigid(start: Floats, end: Floats) -> Floats:
    """Fit a turn and a shift by least squares (Umeyama 1991, without scale).

    Parameters
    ----------
    start, end : ndarray
        (n, 2) the same points before and after.

    Returns
    -------
    ndarray
        (3, 3).
    """
    a, b = start.mean(axis=0), end.mean(axis=0)
    p, q = start - a, end - b
    turn = np.arctan2((p[:, 1] * q[:, 0] - p[:, 0] * q[:, 1]).sum(), (p * q).sum())
    R = rotation(turn).T
    motion = np.eye(3)
    motion[:2, :2], motion[:2, 2] = R, b - R @ a
    return motion


def apply_motion(motion: Floats, points: Floats) -> Floats:
    """Carry points (n, 2) along with a motion (3, 3)."""
    return points @ motion[:2, :2].T + motion[:2, 2]


def inverse_motion(motion: Floats) -> Floats:
    """Give the motion (3, 3) that undoes another."""
    return np.asarray(np.linalg.inv(motion), dtype=float)


def turn_of(motion: Floats) -> float:
    """Tell by how much a motion (3, 3) turns, rad."""
    return float(np.arctan2(motion[0, 1], motion[0, 0]))
