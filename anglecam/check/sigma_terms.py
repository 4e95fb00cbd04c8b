"""The terms of a clip's sigma by their cause, from a part of the clip, and sigma for the whole of it.

The terms are those of the budget, gathered by what a user can change: noise of the pixels, errors of codec and pixel
grid, pivot, zero, view (lens and tilt), exposure. Between a part and the whole film the terms of one frame stay as they
are. Pivot and zero are means over frames, so their variance falls in proportion to the frames that determine them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace

import numpy as np

from anglecam.budget.collect import error_sources
from anglecam.budget.terms import terms_over_time
from anglecam.data.typing import Floats, Integers
from anglecam.io.rig import Rig
from anglecam.measurement.clip import Measurement

SPREAD = 2.0
"""Factor within which a predicted sigma holds in 90 % of the films of ``benchmarks/check_films.py`` and
``benchmarks/check_real.py``, rounded: 14 of 16 lie within it, and nine tenths within 1.9."""
LEARNT = 120
"""Frames from which a body and its centre are learnt at most; more do not make the pivot surer."""

_CAUSES = {
    "picture noise": "noise",
    "pixel grid and codec": "grid",
    "pivot": "pivot",
    "mark's position on the body": "zero",
    "neutral line": "zero",
    "lens": "view",
    "camera tilt": "view",
    "acceleration in the exposure": "exposure",
}
"""Cause of each term of the budget; registration is divided between noise and grid."""


@dataclass(frozen=True)
class SigmaTerms:
    """Standard uncertainties of the angle by cause, RMS over frames, rad."""

    noise: float = 0.0
    """Noise of the pixels."""
    grid: float = 0.0
    """Pixel grid, codec and light: alike in frames of one pose."""
    pivot: float = 0.0
    zero: float = 0.0
    """The zero of the angle."""
    view: float = 0.0
    """Lens and tilt."""
    exposure: float = 0.0
    """Motion within the exposure."""

    @property
    def sigma(self) -> float:
        """All terms together, rad."""
        return math.sqrt(sum(getattr(self, f.name) ** 2 for f in fields(self)))

    @property
    def scatter(self) -> float:
        """What differs from frame to frame or from pose to pose, rad."""
        return math.hypot(self.noise, self.grid)


def sigma_terms(measured: Measurement, rig: Rig) -> SigmaTerms:
    """Return the terms of a measured clip, or of a part of one.

    Parameters
    ----------
    measured : Measurement
        With at least one measured frame.
    rig : Rig
        As the clip was measured with.

    Returns
    -------
    SigmaTerms
        Their `SigmaTerms.sigma` is the RMS over frames of the sigma that the measurement states.
    """
    variances = dict.fromkeys((f.name for f in fields(SigmaTerms)), 0.0)
    sources = error_sources(measured, rig)
    for term in terms_over_time(sources):
        if not term.in_sigma:
            continue
        variance = term.contribution**2
        if term.name == "registration":
            noise = _noise_share(measured, sources.frame - measured.series.first_frame)
            variances["noise"] += float(np.mean(noise * variance))
            variances["grid"] += float(np.mean((1.0 - noise) * variance))
        else:
            variances[_CAUSES[term.name]] += float(np.mean(variance))
    return SigmaTerms(**{name: math.sqrt(variance) for name, variance in variances.items()})


def _noise_share(measured: Measurement, rows: Integers) -> Floats:
    """Return (n,) the share of a registered rotation's variance that is the pixels' noise."""
    found = measured.angles.registered
    assert found is not None  # else there is no such term
    noise, pose = found.noise[rows] ** 2, found.pose[rows] ** 2
    return np.where(np.isfinite(noise), noise / np.maximum(noise + pose, 1e-300), 0.0)


def whole_film(part: SigmaTerms, measured: Measurement, frames: int, commanded: bool) -> SigmaTerms:
    """Return the terms of a whole film from those of a part.

    Parameters
    ----------
    part : SigmaTerms
        Of the part.
    measured : Measurement
        The part.
    frames : int
        Frames of the whole film.
    commanded : bool
        Whether a command is known, so that zero is the rest before its first change.

    Returns
    -------
    SigmaTerms
        Pivot and zero by more frames. A pivot that is declared, marked or hinted is not known better by a longer film.
    """
    read = len(measured.series.time)
    by_path = measured.pivot.startswith("centre") and measured.angles.registered is None
    most = math.inf if by_path else float(LEARNT)
    fixed = "declared" in measured.pivot or (measured.angles.registered is None and not by_path)
    more_poses = 1.0 if fixed else max(1.0, min(frames, most) / min(read, most))
    more_zero = 1.0 if commanded else max(1.0, frames / read)
    return replace(part, pivot=part.pivot / math.sqrt(more_poses), zero=part.zero / math.sqrt(more_zero))
