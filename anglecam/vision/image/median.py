"""Medians of pictures: pixel by pixel over many of them, or of all bytes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Image

_STRIP = 1 << 16
"""Values of each picture that are sorted at a time: this many fit into the processor's cache."""
_DISTINCT = 0.25
"""Least mean square difference of distinct pictures, relative to that of the two which differ most."""
_FEWEST = 5
"""Distinct pictures of which the median is taken; of fewer, two may show the same thing in the same place."""
_EVERY_PX = 4
"""Distance of the pixels that are compared, px."""


def median_picture(pile: NDArray[Any]) -> NDArray[Any]:
    """Return the median over the first axis, equal to ``np.median(pile, axis=0)`` and several times as fast.

    There are few pictures and many pixels. All pixels are therefore sorted at once by comparing whole pictures, with
    a bubble sort that stops in the middle.

    Parameters
    ----------
    pile : ndarray
        (n, …) without NaN.

    Returns
    -------
    ndarray
        (…) of the pile's dtype where that is a floating-point type, otherwise of double precision.
    """
    flat = pile.reshape(len(pile), -1)
    dtype = pile.dtype if np.issubdtype(pile.dtype, np.floating) else np.dtype(float)
    middle = np.empty(flat.shape[1], dtype)
    for start in range(0, flat.shape[1], _STRIP):
        middle[start : start + _STRIP] = _median(flat[:, start : start + _STRIP], dtype)
    return middle.reshape(pile.shape[1:])


def median_of_bytes(values: Image) -> float:
    """Return the median of bytes of any shape, equal to ``np.median`` of them; they are counted, not sorted."""
    upto = np.cumsum(np.bincount(values.ravel(), minlength=256))
    middle = (values.size - 1) // 2, values.size // 2
    return float(np.searchsorted(upto, middle, side="right").mean())


def still_background(pictures: Sequence[Image]) -> NDArray[np.float32]:
    """Return the background of a thing that moves, and that may rest in one place for most of the clip.

    The median of all pictures would show it there. Pictures are therefore chosen one by one, each the one that differs
    most from all chosen before, as long as one differs (Gonzalez 1985), and their median is taken.

    Parameters
    ----------
    pictures : sequence of ndarray
        (h, w, planes), spread over the clip.

    Returns
    -------
    ndarray
        (h, w, planes).
    """
    small = np.stack([cv2.GaussianBlur(p, (0, 0), _EVERY_PX / 2.0)[::_EVERY_PX, ::_EVERY_PX] for p in pictures])
    flat = small.reshape(len(small), -1).astype(np.float32)
    apart = np.stack([((flat - one) ** 2).mean(axis=1) for one in flat])
    first = int(np.median(apart, axis=1).argmin())
    chosen, nearest = [first], apart[first]
    while nearest.max() > _DISTINCT * apart.max():
        chosen.append(int(nearest.argmax()))
        nearest = np.minimum(nearest, apart[chosen[-1]])
    some = chosen if len(chosen) >= _FEWEST else range(len(pictures))
    return median_picture(np.stack([pictures[i] for i in some])).astype(np.float32)


def _median(rows: NDArray[Any], dtype: np.dtype[Any]) -> NDArray[Any]:
    rows, smaller = rows.copy(), np.empty_like(rows[0])
    lower = (len(rows) - 1) // 2
    for last in range(len(rows) - 1, max(lower, 1) - 1, -1):
        for k in range(last):
            np.minimum(rows[k], rows[k + 1], out=smaller)
            np.maximum(rows[k], rows[k + 1], out=rows[k + 1])
            rows[k] = smaller
    if len(rows) % 2:
        return rows[lower].astype(dtype)
    return (rows[lower].astype(dtype) + rows[lower + 1].astype(dtype)) / dtype.type(2.0)
