"""Size and AR(1) coefficient of the angle's noise, estimated from data that no motion changes.

In a film that is the mark's distance from the pivot. It includes errors that a picture at rest hides: the pixel grid
and the codec under a moving edge. In a series without a film it is the rest before the first command change, during
which the mechanism may still be disturbed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from anglecam.data.record import Record
from anglecam.data.typing import Floats

DISTANCE = "distance from the pivot"
"""Source of noise estimated from the mark's distance from the pivot."""
MEASURED = "stated by the measurement"
"""Source of noise whose size the measurement states and whose correlation the distance from the pivot shows."""
MIN_REST_FRAMES = 6
"""Fewest frames of a rest; a shorter rest does not determine the AR(1) coefficient."""


@dataclass(frozen=True)
class Noise:
    """First-order autoregressive noise."""

    sigma: float
    """Standard deviation, rad."""
    phi: float
    """AR(1) coefficient, frame to frame."""
    phi_error: float
    """Standard error of ``phi``."""
    source: str
    """`DISTANCE`, `MEASURED`, ``rest``, ``stated`` or ``residual``."""

    @property
    def filmed(self) -> bool:
        """Whether the noise is a camera's, whose errors may follow the motion."""
        return self.source in (DISTANCE, MEASURED)


def noise_floor(records: Sequence[Record]) -> Noise | None:
    """Return the noise of the angles, independent of any model.

    Parameters
    ----------
    records : sequence of Record
        Recordings by one camera.

    Returns
    -------
    Noise or None
        The smaller of the stated uncertainty and the noise from the mark's distance: angles that registration of the
        whole body gives are better than that distance shows. ``None`` if nothing determines the noise.
    """
    estimated, stated = motion_free_noise(records), stated_noise(records)
    if estimated is None or stated is None:
        return estimated or stated
    if estimated.filmed and stated.sigma < estimated.sigma:
        return replace(estimated, sigma=stated.sigma, source=MEASURED)
    return estimated


def motion_free_noise(records: Sequence[Record]) -> Noise | None:
    """Estimate the noise from data that no motion changes.

    Parameters
    ----------
    records : sequence of Record
        Recordings by one camera.

    Returns
    -------
    Noise or None
        From the distance to the pivot if there are marks, otherwise from the rest; ``None`` if there is neither.
    """
    scatters = [r.lever_scatter for r in records if r.lever_scatter is not None]
    if scatters:
        return autoregression(scatters, DISTANCE)
    rests = []
    for record in records:
        change = record.command.first_change() if record.command else None
        if change is not None and (record.time < change).sum() >= MIN_REST_FRAMES:
            rests.append(record.angle[record.time < change])
    return autoregression(rests, "rest") if rests else None


def stated_noise(records: Sequence[Record]) -> Noise | None:
    """Return the RMS stated uncertainty as noise of unknown AR(1) coefficient; ``None`` where none is stated."""
    stated = np.concatenate([r.sigma for r in records])
    stated = stated[np.isfinite(stated)]
    return Noise(float(np.sqrt(np.mean(stated**2))), 0.0, 1.0, "stated") if len(stated) else None


def autoregression(parts: Sequence[Floats], source: str) -> Noise:
    """Fit one AR(1) process to several stretches of data.

    Parameters
    ----------
    parts : sequence of (n,) ndarray
        Stretches, rad; the mean of each is subtracted.
    source : str
        Description of the data.

    Returns
    -------
    Noise
        With φ corrected for the bias that subtracting the means causes, and clipped to [0, 0.98].
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
