"""Numba's types of the arrays that compiled functions take: contiguous; those named ``READ`` may be read-only."""

from __future__ import annotations

from numba import types

VECTOR = types.Array(types.float64, 1, "C")
MATRIX = types.Array(types.float64, 2, "C")
READ_VECTOR = types.Array(types.float64, 1, "C", readonly=True)
READ_MATRIX = types.Array(types.float64, 2, "C", readonly=True)
READ_COUNTS = types.Array(types.int64, 1, "C", readonly=True)
READ_TABLE = types.Array(types.int64, 2, "C", readonly=True)
