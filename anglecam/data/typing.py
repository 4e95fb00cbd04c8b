"""Names of the array types that the packages exchange."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Integers = NDArray[np.int64]
Image = NDArray[Any]
"""8-bit picture, (height, width, channels); OpenCV's type hints have no ``uint8`` arrays."""
