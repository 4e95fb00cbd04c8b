"""Rigid motions in the picture plane: a rotation and a translation as a 3 × 3 matrix of homogeneous coordinates.

Rotations are counter-clockwise positive as seen in the picture, although y points down.
"""

from __future__ import annotations

import numpy as np

from anglecam.data.typing import Floats


def rotation(turns: float | Floats) -> Floats:
    """Return the matrices that rotate row vectors: ``v @ M`` is v rotated counter-clockwise as seen, y down.

    Parameters
    ----------
    turns : float or ndarray
        (…) rad.

    Returns
    -------
    ndarray
        (…, 2, 2).
    """
    matrices = np.empty((*np.shape(turns), 2, 2))
    c, s = np.cos(turns), np.sin(turns)
    matrices[..., 0, 0], matrices[..., 0, 1], matrices[..., 1, 0], matrices[..., 1, 1] = c, -s, s, c
    return matrices


def rotate_each(arms: Floats, turns: Floats) -> Floats:
    """Rotate points by an angle each, without the memory of a matrix for each.

    Parameters
    ----------
    arms : ndarray
        (n, 2), or (2,) for one that is rotated by all angles.
    turns : ndarray
        (n,) counter-clockwise as seen, rad.

    Returns
    -------
    ndarray
        (n, 2).
    """
    c, s = np.cos(turns), np.sin(turns)
    return np.stack([c * arms[..., 0] + s * arms[..., 1], -s * arms[..., 0] + c * arms[..., 1]], axis=-1)


def turn_of(motion: Floats) -> float:
    """Return the rotation angle of a motion (3, 3), rad."""
    return float(np.arctan2(motion[0, 1], motion[0, 0]))
