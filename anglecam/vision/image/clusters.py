"""Points that lie together.

Neighbours err together, as they share a codec's blocks and the light that falls on them: an uncertainty is told from
how much groups disagree that lie apart.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.vq import kmeans2


def group_neighbours(points: NDArray[np.float64], count: int) -> NDArray[np.intp]:
    """Put points that lie together into groups (k-means, started as by Arthur and Vassilvitskii 2007).

    Parameters
    ----------
    points : ndarray
        (n, 2) px.
    count : int
        Of groups; where there are no more than two points for each, every point is a group of its own.

    Returns
    -------
    ndarray
        (n,) number of the group that each is in.
    """
    if len(points) <= 2 * count:
        return np.arange(len(points))
    return np.asarray(kmeans2(points, count, minit="++", seed=0)[1])
