"""The exposure time from the length of a mark that moves: its second moment grows with the square of its speed.

Uniform motion over an exposure T smears a mark over L = v·T. The second central moment of the fraction of mark along
the path is the sum of the mark's own and that of a box of length L, L²/12, whatever the shape of the mark. A straight
line through the moments against v² has the slope T²/12.
"""

from __future__ import annotations

import math

import numpy as np

from anglecam.measurement.clip import Measurement

FEWEST = 20
"""Fewest frames for an estimate."""
LEAST_SIGMAS = 4.0
"""Standard errors by which the slope has to exceed zero: a film without blur has no exposure to state."""
CUT_OFF = 0.15
"""Relative standard uncertainty of the exposure because the faint ends of a blurred mark are cut off with the noise: of
the drawn films in the tests and in ``benchmarks/check_films.py``, with 10 ms to 25 ms."""
ROUNDS = 5
"""Reweightings against frames in which a part of the mark is hidden."""


def exposure_from_blur(measured: Measurement) -> tuple[float, float] | None:
    """Estimate the exposure time of a clip.

    Parameters
    ----------
    measured : Measurement
        Of consecutive frames.

    Returns
    -------
    (float, float) or None
        Exposure time and its standard uncertainty, s; ``None`` where no mark is followed or no blur is seen.
    """
    series, detections = measured.series, measured.detections
    if series.line is None or detections.body is not None:
        return None
    seen = [i for i, r in enumerate(detections.regions) if r is not None and series.ok[i]]
    if len(seen) < FEWEST:
        return None
    regions = [r for i in seen if (r := detections.regions[i]) is not None]
    arm = np.array([r.centre_px for r in regions]) - measured.angles.pivot.centre_px
    lever = np.hypot(*arm.T)
    along = np.column_stack([-arm[:, 1], arm[:, 0]]) / lever[:, None]
    length = np.einsum("ni,nij,nj->n", along, np.array([r.moments_px2 for r in regions]), along)
    speed2 = (np.gradient(series.line[seen], series.time[seen]) * lever) ** 2
    design = np.column_stack([np.ones(len(seen)), speed2 / max(float(speed2.max()), 1e-12)])
    weights = np.ones(len(seen))
    for _ in range(ROUNDS):
        root = np.sqrt(weights)
        values, *_ = np.linalg.lstsq(design * root[:, None], length * root, rcond=None)
        off = length - design @ values
        scale = max(1.4826 * float(np.median(np.abs(off))), 1e-9)
        weights = 1.0 / np.maximum(1.0, np.abs(off) / (2.0 * scale))
    weighted = design * weights[:, None]
    bread = np.linalg.inv(design.T @ weighted)
    spread = math.sqrt(float((bread @ (weighted.T * off**2) @ weighted @ bread)[1, 1]))
    if not values[1] > LEAST_SIGMAS * spread:
        return None
    exposure = math.sqrt(12.0 * float(values[1]) / float(speed2.max()))
    return exposure, exposure * math.hypot(0.5 * spread / float(values[1]), CUT_OFF)
