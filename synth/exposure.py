"""Exposure of a frame: the light is an integral over time, here a weighted sum over a few instants.

Row y of a frame taken at t is open for the exposure E around t + row_time·(y − middle row). The picture is assumed to
change linearly between instants, so an instant's weight in a row is the integral of a hat function over the time for
which the row is open. Hat functions preserve means: the mean time of every row is exact for any number of instants.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Light = NDArray[np.float32]

STILL_PX = 0.1
"""If the mark moves less than this during the exposure, a single instant is drawn, px."""


@dataclass(frozen=True)
class Shutter:
    """How the rows of a frame are exposed."""

    exposure_s: float
    row_time_s: float
    rows: int

    @property
    def span_s(self) -> float:
        """Return the time from the first row's opening to the last row's closing, s."""
        return self.exposure_s + self.row_time_s * (self.rows - 1)

    def row_times(self, taken: float) -> Floats:
        """Return the middle of each row's exposure, s: shape (rows,), or (1,) for a global shutter."""
        if self.row_time_s == 0.0:
            return np.array([taken])
        return np.asarray(taken + self.row_time_s * (np.arange(self.rows) - (self.rows - 1) / 2))


@dataclass(frozen=True)
class Instants:
    """The times at which a frame is drawn, and the weight of each drawing in each row."""

    times: Floats
    """(n,), s."""
    weights: Floats
    """(n, rows) or (n, 1); every column sums to 1."""


def instants(shutter: Shutter, taken: float, path_px: float, step_px: float) -> Instants:
    """Choose the instants of one frame.

    Parameters
    ----------
    shutter : Shutter
        Exposure and rolling shutter.
    taken : float
        Time of the frame, s.
    path_px : float
        Distance the mark moves in the picture during the exposure, px.
    step_px : float
        Largest distance between two instants, px.

    Returns
    -------
    Instants
        A single one where the mark moves less than `STILL_PX`.
    """
    if path_px <= STILL_PX:
        return Instants(np.array([taken]), np.ones((1, 1)))
    steps = max(1, math.ceil(path_px / step_px))
    times = taken + shutter.span_s * (np.arange(steps + 1) / steps - 0.5)
    spacing = shutter.span_s / steps
    rows = shutter.row_times(taken)
    away = (rows[None, :] - times[:, None]) / spacing
    if shutter.exposure_s == 0.0:
        return Instants(times, np.maximum(0.0, 1 - np.abs(away)))
    half = shutter.exposure_s / spacing / 2
    return Instants(times, (_below_hat(away + half) - _below_hat(away - half)) / (2 * half))


@njit("(float32[::1], float32[:, :, ::1], float32[:, :, ::1])", cache=True, error_model="numpy")
def expose(weights: Light, drawn: Light, total: Light) -> None:
    """Add the drawing of one instant to the light of a frame; in one pass, as pictures are larger than caches.

    Parameters
    ----------
    weights : ndarray
        (rows,) or (1,), weight of the drawing in each row.
    drawn, total : ndarray
        (rows, width, 3); the second is written.
    """
    for row in range(len(drawn)):
        weight, light, exposed = weights[row % len(weights)], drawn[row].ravel(), total[row].ravel()
        for n in range(len(light)):
            exposed[n] += weight * light[n]


def _below_hat(x: Floats) -> Floats:
    """Return the integral of the hat function max(0, 1 − |x|) from −∞ to x."""
    inside = np.clip(x, -1.0, 1.0)
    return np.where(inside < 0, (1 + inside) ** 2 / 2, 1 - (1 - inside) ** 2 / 2)
