"""Quantisation: the step of an encoder or of a converter, found in the angles themselves, and the errors that it makes.

All angles of a quantised series lie on one grid, apart from the rounding of the file that holds them. Angles without a
grid do not: whatever the step, they lie between its lines as often as on them. The offset of the grid is that of the
recording's zero. A quantiser's error is uniform with variance step²/12, and white where the motion crosses several
steps from frame to frame; at rest it is constant. Widrow, Kollár, Quantization Noise, 2008, ch. 5.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from anglecam.data.record import Record
from anglecam.data.typing import Floats

ON_GRID = 0.1
"""Largest distance of an angle from a line of the grid, in steps: room for the file's rounding."""
ON_GRID_SHARE = 0.98
"""Share of the angles that must be on the grid; the others may be glitches. Among n angles without a grid a share of
0.2 is, so 20 of them are on it by chance with a probability of 10⁻¹²."""
FEWEST_LEVELS = 4
"""Different angles; fewer lie on some grid whatever they are."""
TRIED = (0.0, 0.01, 0.05, 0.25, 0.5, 0.75)
"""Quantiles of the gaps between neighbouring angles that are tried as the step."""
GROWTH = 1.5
"""Ratio of the longest gaps, in steps, between two refinements of the step."""
ROUNDING = 1e-9
"""rad; angles closer together are the same."""
DIFFERENCES = 6
"""Order of the differences that leave noise, and hardly anything of a motion that is slow against the frame rate."""
WINDOW = 8
"""Frames over which their size is averaged."""
QUIETEST = 0.1
"""Share of the windows, the quietest ones, that show the noise."""
MOST_NOISE = 0.5
"""Steps of scatter in the quietest windows above which other noise hides the quantisation: noise of a standard
deviation of one step makes its error white and independent of the motion to within exp(−2π²)."""


@dataclass(frozen=True)
class Grid:
    """The lines between which the angles of several recordings are rounded."""

    step: float
    """Distance of two lines, rad."""
    offsets: tuple[float, ...]
    """A line of each recording's grid, rad."""

    @property
    def sigma(self) -> float:
        """Standard deviation of a uniformly distributed rounding error, step/√12, rad."""
        return self.step / math.sqrt(12.0)

    def rounded(self, paths: Sequence[Floats]) -> list[Floats]:
        """Round (n,) or (n, k) angles, rad, of each recording to its grid."""
        return [
            offset + self.step * np.round((path - offset) / self.step)
            for path, offset in zip(paths, self.offsets, strict=True)
        ]


def quantisation(records: Sequence[Record]) -> Grid | None:
    """Find the common step of the angles of several recordings.

    Parameters
    ----------
    records : sequence of Record
        By one instrument.

    Returns
    -------
    Grid or None
        ``None`` if the angles lie on no grid, or if other noise is larger than its step, as in a file that is printed
        with more decimals than the measurement has.

    Examples
    --------
    An encoder with 4096 steps a turn:

    >>> time = np.arange(0.0, 4.0, 0.02)
    >>> step = 2.0 * np.pi / 4096
    >>> angle = step * np.round(0.3 * np.sin(3.0 * time) / step)
    >>> one = Record("one", time, angle, None, False, np.full(len(time), np.nan))
    >>> round(float(np.degrees(quantisation([one]).step)), 6)
    0.087891
    """
    levels = [_distinct(r.angle) for r in records]
    if max(len(values) for values in levels) < FEWEST_LEVELS:
        return None
    gaps = np.sort(np.concatenate([np.diff(values) for values in levels]))
    tried = dict.fromkeys(np.quantile(gaps, TRIED, method="nearest").tolist())
    found = [grid for start in tried if (grid := _grid(records, gaps, start)) is not None]
    widest = max(found, key=lambda grid: grid.step, default=None)
    return widest if widest is not None and _quietest(records) < MOST_NOISE * widest.step else None


def _distinct(angle: Floats) -> Floats:
    """Return the different values of an angle, increasing."""
    values = np.sort(angle)
    return values[np.append(True, np.diff(values) > ROUNDING)]


def _grid(records: Sequence[Record], gaps: Floats, start: float) -> Grid | None:
    """Refine a step from short gaps to long ones, whose number of steps is known ever better, and test it."""
    step, longest = start, GROWTH
    while True:
        used = gaps[gaps < longest * step]
        counts = np.round(used / step)
        step = float(used @ counts / (counts @ counts))
        if len(used) == len(gaps):
            break
        longest *= GROWTH
    offsets, off = [], []
    for record in records:
        turns = np.exp(2j * np.pi * record.angle / step)
        offset = float(np.angle(np.mean(turns))) / (2.0 * np.pi) * step
        offsets.append(offset)
        off.append(record.angle - offset - step * np.round((record.angle - offset) / step))
    on_grid = np.abs(np.concatenate(off)) < ON_GRID * step
    return Grid(step, tuple(offsets)) if on_grid.mean() >= ON_GRID_SHARE else None


def _quietest(records: Sequence[Record]) -> float:
    """Return the scatter of the angle, rad, in the windows in which it is smallest: noise, and little motion."""
    norm = math.sqrt(math.comb(2 * DIFFERENCES, DIFFERENCES))
    scatters = []
    for record in records:
        left = np.diff(record.angle, DIFFERENCES) / norm
        count = len(left) // WINDOW
        scatters.append(np.sqrt(np.mean(left[: count * WINDOW].reshape(count, WINDOW) ** 2, axis=1)))
    return float(np.quantile(np.concatenate(scatters), QUIETEST)) if any(len(one) for one in scatters) else math.inf
