"""The median of many pictures, pixel by pixel."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

_STRIP = 1 << 16
"""Numbers of each picture that are put in order at a time: so many stay in the processor's cache."""


def median_picture(pile: NDArray[Any]) -> NDArray[Any]:
    """Find the median over the first axis: what ``np.median(pile, axis=0)`` gives, several times as fast.

    There are few pictures and many pixels, so that all pixels are put in order at once, by comparing whole pictures:
    a bubble sort that stops in the middle.

    Parameters
    ----------
    pile : ndarray
        (n, …) without NaN.

    Returns
    -------
    ndarray
        (…), of the pile's kind where that is a kind of float, else in double precision.
    """
    flat = pile.reshape(len(pile), -1)
    kind = pile.dtype if np.issubdtype(pile.dtype, np.floating) else np.dtype(float)
    middle = np.empty(flat.shape[1], kind)
    for start in range(0, flat.shape[1], _STRIP):
        middle[start : start + _STRIP] = _median(flat[:, start : start + _STRIP], kind)
    return middle.reshape(pile.shape[1:])


def _median(rows: NDArray[Any], kind: np.dtype[Any]) -> NDArray[Any]:
    rows, smaller = rows.copy(), np.empty_like(rows[0])
    lower = (len(rows) - 1) // 2
    for last in range(len(rows) - 1, max(lower, 1) - 1, -1):
        for k in range(last):
            np.minimum(rows[k], rows[k + 1], out=smaller)
            np.maximum(rows[k], rows[k + 1], out=rows[k + 1])
            rows[k] = smaller
    if len(rows) % 2:
        return rows[lower].astype(kind)
    return (rows[lower].astype(kind) + rows[lower + 1].astype(kind)) / kind.type(2.0)
