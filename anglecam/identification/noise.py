"""What the camera adds: the size and colour of the angle's noise, from what cannot be motion.

In a film that is the mouth's distance from the pivot, which no motion alters; it sees what a picture at rest hides,
the pixel grid and the codec under a moving edge. In a series from elsewhere it is the rest before the first command
change, where the mechanism may still be shaken by something of its own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from anglecam.data.record import Record
from anglecam.data.typing import Floats

DISTANCE = "distance from the pivot"
MEASURED = "the measurement's own statement"
LEAST_REST = 6
"""Frames; a shorter rest says nothing about colour."""


@dataclass(frozen=True)
class Noise:
    """First-order autoregressive noise."""

    sigma: float
    """Standard deviation, rad."""
    phi: float
    """Correlation from frame to frame."""
    phi_error: float
    """Standard error of ``phi``."""
    source: str
    """`DISTANCE`, `MEASURED`, ``rest``, ``stated`` or ``residual``."""

    @property
    def filmed(self) -> bool:
        """Whether it is a camera's, and so goes along with the motion."""
        return self.source in (DISTANCE, MEASURED)


def noise_floor(records: Sequence[Record]) -> Noise | None:
    """Say how good the angles are, apart from any model.

    Parameters
    ----------
    records : sequence of Record
        Recordings by one camera.

    Returns
    -------
    Noise or None
        Where a film's angles are the whole head's, they are better than the mouth's distance from the pivot tells, and
        their own statement counts; ``None`` where nothing tells.
    """
    witness, stated = motion_free_noise(records), stated_noise(records)
    if witness is None or stated is None:
        return witness or stated
    if witness.filmed and stated.sigma < witness.sigma:
        return replace(witness, sigma=stated.sigma, source=MEASURED)
    return witness


def motion_free_noise(records: Sequence[Record]) -> Noise | None:
    """Estimate the noise from what cannot be motion.

    Parameters
    ----------
    records : sequence of Record
        Recordings by one camera.

    Returns
    -------
    Noise or None
        From the distance to the pivot where there are marks, else from the rest; ``None`` where there is neither.
    """
    crosses = [r.lever_scatter for r in records if r.lever_scatter is not None]
    if crosses:
        return autoregression(crosses, DISTANCE)
    rests = []
    for record in records:
        change = record.command.first_change() if record.command else None
        if change is not None and (record.time < change).sum() >= LEAST_REST:
            rests.append(record.angle[record.time < change])
    return autoregression(rests, "rest") if rests else None


def stated_noise(records: Sequence[Record]) -> Noise | None:
    """Return the stated uncertainties, root mean square, as noise of unknown colour; ``None`` where none is stated."""
    stated = np.concatenate([r.sigma for r in records])
    stated = stated[np.isfinite(stated)]
    return Noise(float(np.sqrt(np.mean(stated**2))), 0.0, 1.0, "stated") if len(stated) else None


def autoregression(parts: Sequence[Floats], source: str) -> Noise:
    """Fit one AR(1) process to several stretches.

    Parameters
    ----------
    parts : sequence of (n,) ndarray
        Stretches, rad; each is taken about its own mean.
    source : str
        What they are, for the reader.

    Returns
    -------
    Noise
        With φ corrected for the bias that taking out the means brings, and kept within [0, 0.98].
    """
    total = count = lagged = pairs = 0.0
    for part in parts:
        e = part - part.mean()
        total += e @ e
        count += len(e) - 1
        lagged += e[1:] @ e[:-1]
        pairs += len(e) - 1
    if total <= 0.0:
        return Noise(0.0, 0.0, 1.0 / math.sqrt(max(pairs, 1.0)), source)
    length = pairs / len(parts) + 1.0
    raw = lagged / total * length / (length - 1.0)
    phi = (raw * length + 1.0) / (length - 3.0) if length > 6 else raw
    phi = min(max(phi, 0.0), 0.98)
    return Noise(math.sqrt(total / count), phi, math.sqrt((1.0 - phi**2) / pairs), source)
