"""Where a residual sits: the regions of angle, velocity, command, phase and time in which it is larger than elsewhere.

Each quantity is cut into bins with equally many frames. The energy of a bin is compared with that of the same residual
shifted in time, round and round within its recording: if it has nothing to do with the quantity, every shift is as
probable, whatever its size and its correlation. The rate of false discoveries is controlled over all bins of all
quantities (Benjamini and Hochberg, J. R. Statist. Soc. B 57, 1995). Neighbouring bins are one region.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from anglecam.data.record import Record
from anglecam.data.typing import Floats

BINS = 8
"""Of each quantity."""
DRAWS = 1999
"""Random shifts."""
FALSE_DISCOVERIES = 0.05
"""Expected share of the regions in which the residual is no larger than elsewhere."""


@dataclass(frozen=True)
class Seat:
    """A region in which the residual is larger than elsewhere."""

    variable: str
    """``angle``, ``velocity``, ``command``, ``phase`` or ``time``."""
    start: float
    """Rad, rad/s, rad, share of the command's period, or s from the recording's begin."""
    stop: float
    """In the same unit."""
    share_of_excess: float
    """Part of the residual's energy beyond the noise."""
    q_value: float
    """Rate of false discoveries at which it is just found."""


def seats_of(
    records: Sequence[Record], residuals: Sequence[Floats], noise_sigma: float, rng: np.random.Generator
) -> tuple[Seat, ...]:
    """Find the regions in which residuals are larger than elsewhere.

    Parameters
    ----------
    records : sequence of Record
        Recordings that a model predicts.
    residuals : sequence of (n,) ndarray
        Measured minus predicted angle of each, rad.
    noise_sigma : float
        Standard deviation of the noise, rad; 0 if it is unknown.
    rng : numpy.random.Generator
        For the shifts.

    Returns
    -------
    tuple of Seat
        Largest share first; empty where the residual is as large everywhere.
    """
    energy = [residual**2 for residual in residuals]
    shifted = np.stack(
        [np.concatenate([np.roll(one, rng.integers(len(one))) for one in energy]) for _ in range(DRAWS)],
        axis=1,
    )
    whole = np.concatenate(energy)
    found = list[tuple[str, float, float, Floats, float]]()
    for name, values in _quantities(records, residuals).items():
        known = np.isfinite(values)
        edges = np.unique(np.quantile(values[known], np.linspace(0.0, 1.0, BINS + 1))) if known.any() else np.empty(0)
        if len(edges) < 3:  # the same everywhere
            continue
        place = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
        for k in range(len(edges) - 1):
            inside = known & (place == k)
            by_chance = 1 + np.count_nonzero(inside @ shifted >= inside @ whole)
            found.append((name, float(edges[k]), float(edges[k + 1]), inside, by_chance / (DRAWS + 1)))
    if not found:
        return ()
    q = stats.false_discovery_control([one[-1] for one in found])
    excess = max(float(np.sum(whole - noise_sigma**2)), 1e-300)
    regions = list[Seat]()
    for (name, start, stop, inside, _), rate in zip(found, q.tolist(), strict=True):
        if rate > FALSE_DISCOVERIES:
            continue
        share = float(np.sum(whole[inside] - noise_sigma**2)) / excess
        if regions and regions[-1].variable == name and regions[-1].stop == start:
            last = regions.pop()
            start, share, rate = last.start, last.share_of_excess + share, max(last.q_value, rate)
        regions.append(Seat(name, start, stop, share, rate))
    return tuple(sorted(regions, key=lambda one: -one.share_of_excess))


def _quantities(records: Sequence[Record], residuals: Sequence[Floats]) -> Mapping[str, Floats]:
    """Return what the residual may depend on, at each frame of all recordings; NaN where it is not defined."""
    paths = [record.angle - residual for record, residual in zip(records, residuals, strict=True)]
    each: dict[str, list[Floats]] = {name: [] for name in ("angle", "velocity", "command", "phase", "time")}
    for record, path in zip(records, paths, strict=True):
        unknown = np.full(len(path), np.nan)
        command, cycle = record.command, None if record.command is None else record.command.cycle
        each["angle"].append(path)
        each["velocity"].append(np.gradient(path, record.time))
        each["command"].append(unknown if command is None else command.at(record.time))
        each["phase"].append(unknown if cycle is None else np.mod((record.time - cycle[1]) / cycle[0], 1.0))
        each["time"].append(record.time - record.time[0])
    return {name: np.concatenate(values) for name, values in each.items()}
