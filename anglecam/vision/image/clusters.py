"""Groups of neighbouring points.

Errors of neighbouring points are correlated, because neighbours share the codec's blocks and the light that falls on
them. An uncertainty is therefore estimated from the disagreement between groups of points, not between single points.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.vq import kmeans2


def group_neighbours(points: NDArray[np.float64], count: int) -> NDArray[np.intp]:
    """Assign neighbouring points to the same group (k-means, initialised as in Arthur and Vassilvitskii 2007).

    Parameters
    ----------
    points : ndarray
        (n, 2) px.
    count : int
        Number of groups. With two points or fewer for each group, every point forms a separate group.

    Returns
    -------
    ndarray
        (n,) group number of each point.
    """
    if len(points) <= 2 * count:
        return np.arange(len(points))
    return np.asarray(kmeans2(points, count, minit="++", seed=0)[1])
