"""Reduced pictures of a film, kept in a quarter of their memory to be looked through again."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Image

_UNKNOWN = 0
"""Stands for NaN; black is 1."""


def in_bytes(picture: NDArray[np.float32]) -> Image:
    """Return a picture (h, w), grey levels, NaN where the camera did not look, in bytes."""
    known = np.isfinite(picture)
    return np.where(known, np.clip(np.round(np.where(known, picture, 1.0)), 1, 255), _UNKNOWN).astype(np.uint8)


def in_grey_levels(kept: Image) -> NDArray[np.float32]:
    """Return the picture that was kept in bytes (h, w)."""
    return np.where(kept == _UNKNOWN, np.float32(np.nan), kept).astype(np.float32)
