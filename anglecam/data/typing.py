"""Names for the arrays that pass between rooms."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Integers = NDArray[np.int64]
Image = NDArray[Any]
"""Bytes, (height, width, channels); OpenCV's type hints do not know ``uint8`` arrays."""
