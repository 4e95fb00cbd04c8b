"""Size and AR(1) coefficient of the angle's noise, estimated from data that no model explains.

In a film that is the mark's distance from the pivot. It includes errors that a picture at rest hides: the pixel grid
and the codec under a moving edge. In a series without a film it is, in this order: the stated uncertainty, the step of
a quantised angle, the rest before the first command change, and recordings of one command that were repeated. A rest
counts only if the angle shows neither a trend nor a swing in it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy import special

from anglecam.data.record import Record
from anglecam.data.typing import Floats
from anglecam.identification.quantisation import DIFFERENCES, quantisation

DISTANCE = "distance from the pivot"
"""Source of noise estimated from the mark's distance from the pivot."""
MEASURED = "stated by the measurement"
"""Source of noise whose size the measurement of a film states; its correlation is that of the distance from the pivot,
where a mark shows one."""
QUANTISED = "step of the angles"
"""Source of noise that is the rounding of the angles to a grid."""
REST, REPEATED = "rest", "repeated recordings"
RESIDUAL = "residual of the model, which bounds it"
"""Source where nothing but a model shows the noise: what the model leaves is noise, structure, or both."""
MIN_REST_FRAMES = 8
"""Fewest frames of a rest; a shorter one shows neither a trend nor a swing."""
MOVING_RATE = 0.01
"""Probability with which noise alone makes a rest count as motion."""
MOST_REST_PHI = 0.9
"""AR(1) coefficient above which the noise of a rest cannot be distinguished from slow motion."""
REPEATED_START = 3.0
"""Largest difference of two recordings in their first frames, in standard deviations of their difference, for them to
have started alike."""
SHARE_SCATTER = 1.5
"""Standard deviation of `correlated_share` in AR(1) noise, relative, times the root of the number of frames: 1.4 to 1.6
for coefficients of 0 to 0.9 and 360 to 4,800 frames."""
ONE_SIDED_95 = 1.645
"""Upper 95 % limit of a normal variable, in standard deviations."""
UNKNOWN = math.inf
"""Standard error of an AR(1) coefficient that nothing determines."""
DOUBTFUL_RESIDUAL = 3.0
"""Multiple of the angle's uncertainty; a model with a larger RMS residual lacks something, so that the stated
uncertainties of its parameters do not hold. Held-out recordings contradict a model if their error is larger than this
multiple of the residual, and of the angle's uncertainty."""
ESTIMATED = (DISTANCE, REST, REPEATED)
"""Sources of a noise whose size is estimated from a limited number of frames."""
LARGEST_PHI = 0.98
"""Largest AR(1) coefficient that is estimated; a larger one would be that of a drift and not of noise."""


@dataclass(frozen=True)
class Noise:
    """First-order autoregressive noise."""

    sigma: float
    """Standard deviation, rad."""
    phi: float
    """AR(1) coefficient, frame to frame."""
    phi_error: float
    """Standard error of ``phi``; `UNKNOWN` if nothing determines it."""
    source: str
    """`DISTANCE`, `MEASURED`, ``stated``, `QUANTISED`, `REST`, `REPEATED` or `RESIDUAL`."""

    @property
    def filmed(self) -> bool:
        """Whether the noise is a camera's, whose errors may follow the motion."""
        return self.source in (DISTANCE, MEASURED)

    @property
    def least_sigma(self) -> float:
        """Lower limit of the 95 % interval of ``sigma``, rad; ``sigma`` itself where it is stated and not estimated.

        The variance of n samples of AR(1) noise scatters as that of n·(1 − φ²)/(1 + φ²) independent ones (Priestley,
        Spectral Analysis and Time Series, 1981, sec. 5.3).
        """
        if self.source not in ESTIMATED:
            return self.sigma
        samples = (1.0 - self.phi**2) / self.phi_error**2
        free = samples * (1.0 - self.phi**2) / (1.0 + self.phi**2)
        return self.sigma * math.sqrt(free / special.chdtri(free, 0.025))

    @property
    def known(self) -> bool:
        """Whether the noise was estimated apart from the model that is judged by it."""
        return self.source != RESIDUAL


def noise_floor(records: Sequence[Record]) -> Noise | None:
    """Return the noise of the angles, independent of any model.

    Parameters
    ----------
    records : sequence of Record
        Recordings by one instrument.

    Returns
    -------
    Noise or None
        Of a film, the smaller of the stated uncertainty and the noise from the mark's distance: angles that
        registration of the whole body gives are better than that distance shows. A body that was followed without a
        mark shows no such distance. Otherwise the stated uncertainty, the
        rounding error of a quantised angle (or the scatter of the rest, if that is larger), the rest, or the scatter
        between repeated recordings, whichever is first available. ``None`` if nothing determines the noise.
    """
    stated = stated_noise(records)
    scatters = [r.lever_scatter for r in records if r.lever_scatter is not None]
    if scatters:
        estimated = autoregression(scatters, DISTANCE)
        smaller = stated is not None and stated.sigma < estimated.sigma
        return replace(estimated, sigma=stated.sigma, source=MEASURED) if stated and smaller else estimated
    if stated is not None and any(record.view.lever_px is not None for record in records):
        return replace(stated, source=MEASURED)
    grid = quantisation(records)
    scatter = _scatter(records)
    if stated is not None:
        # a quantised angle at rest shows no correlation of its noise
        known = scatter is not None and grid is None
        return replace(scatter, sigma=stated.sigma, source=stated.source) if scatter and known else stated
    if grid is not None and (scatter is None or scatter.sigma <= grid.sigma):
        return Noise(grid.sigma, 0.0, UNKNOWN, QUANTISED)
    return scatter


def _scatter(records: Sequence[Record]) -> Noise | None:
    """Return the scatter at rest or, if there is no rest, between repeated recordings; ``None`` without either."""
    rests = [rest for record in records if (rest := _rest(record)) is not None]
    if rests:
        return autoregression(rests, REST)
    differences = [difference / math.sqrt(2.0) for difference in _differences(records)]
    return autoregression(differences, REPEATED) if differences else None


def _rest(record: Record) -> Floats | None:
    """Return the angles before the first command change, rad, if they are at rest."""
    change = record.command.first_change() if record.command else None
    angle = record.angle[:0] if change is None else record.angle[record.time < change]
    return angle if len(angle) >= MIN_REST_FRAMES and not _moves(angle) else None


def _moves(angle: Floats) -> bool:
    """Return whether an angle shows more than AR(1) noise about a constant: a trend, a swing or a slow approach.

    A trend and the angle before the last are no help in predicting AR(1) noise. They are of a swing, which a regression
    on both and on the last angle predicts (F test).
    """
    e = angle - angle.mean()
    if not np.any(e):
        return False
    if autoregression([angle], REST).phi > MOST_REST_PHI:
        return True
    few = np.column_stack([np.ones(len(e) - 2), e[1:-1]])
    many = np.column_stack([few, e[:-2], np.linspace(-1.0, 1.0, len(e) - 2)])
    left = [float(np.sum((e[2:] - x @ np.linalg.lstsq(x, e[2:], rcond=None)[0]) ** 2)) for x in (few, many)]
    free = len(many) - many.shape[1]
    return float(special.fdtrc(2, free, (left[0] - left[1]) / 2.0 / max(left[1] / free, 1e-300))) < MOVING_RATE


def _differences(records: Sequence[Record]) -> Iterator[Floats]:
    """Yield the difference, rad, of every two recordings of one command that started alike, frame by frame."""
    for one, other in combinations(records, 2):
        if one.command is None or other.command is None or len(one.time) != len(other.time):
            continue
        if not (
            np.array_equal(one.command.time, other.command.time)
            and np.array_equal(one.command.angle, other.command.angle)
            and np.allclose(one.time, other.time, rtol=0.0, atol=0.01 * one.interval)
        ):
            continue
        difference = one.angle - other.angle
        off = difference[:MIN_REST_FRAMES].mean() - difference.mean()
        if abs(off) <= REPEATED_START * difference.std() / math.sqrt(MIN_REST_FRAMES):
            yield difference


def stated_noise(records: Sequence[Record]) -> Noise | None:
    """Return the RMS stated uncertainty as noise of unknown AR(1) coefficient; ``None`` where none is stated."""
    stated = np.concatenate([r.sigma for r in records])
    stated = stated[np.isfinite(stated)]
    return Noise(float(np.sqrt(np.mean(stated**2))), 0.0, UNKNOWN, "stated") if len(stated) else None


def angle_uncertainty(records: Sequence[Record]) -> float:
    """Return the RMS standard uncertainty of the angles, rad: as stated, otherwise the noise; 0 if nothing shows it."""
    stated = np.concatenate([r.sigma for r in records])
    if np.all(np.isfinite(stated)):
        return float(np.sqrt(np.mean(stated**2)))
    floor = noise_floor(records)
    return 0.0 if floor is None else floor.sigma


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
        With φ corrected for the bias that subtracting the means causes, and clipped to [0, `LARGEST_PHI`].
    """
    around = [part - part.mean() for part in parts]
    total, pairs = sum(float(e @ e) for e in around), sum(len(e) - 1 for e in around)
    if total <= 0.0:
        return Noise(0.0, 0.0, 1.0 / math.sqrt(max(pairs, 1.0)), source)
    phi = float(ar1_coefficient(around))
    return Noise(math.sqrt(total / pairs), phi, math.sqrt((1.0 - phi**2) / pairs), source)


def correlated_share(parts: Sequence[Floats]) -> float:
    """Return the upper 95 % limit of the share of the variance of some residuals that is AR(1) noise, at most 1.

    AR(1) noise is rough, and what a model lacks is smooth: it follows the motion. The differences of high order of
    AR(1) noise have a known variance.

    Parameters
    ----------
    parts : sequence of (n,) ndarray
        Residuals, evenly spaced. Their coefficient is taken for the noise's, also above `LARGEST_PHI`.
    """
    around = [part - part.mean() for part in parts]
    steps = sum(float(np.sum(np.diff(e) ** 2)) for e in around) / max(1, sum(len(e) - 1 for e in around))
    spread = sum(float(e @ e) for e in around) / sum(map(len, around))
    # near 1 the correction for the bias is larger than the distance from 1, and this estimate needs none
    phi = max(float(ar1_coefficient(around)), 1.0 - steps / (2.0 * spread) if spread > 0.0 else 0.0)
    weights = np.array([(-1.0) ** k * math.comb(DIFFERENCES, k) for k in range(DIFFERENCES + 1)])
    weights /= np.linalg.norm(weights)
    apart = np.abs(np.subtract.outer(np.arange(len(weights)), np.arange(len(weights))))
    of_unit_noise = float(weights @ phi**apart @ weights)
    long = [part for part in parts if len(part) > DIFFERENCES]
    variance = float(np.mean(np.concatenate(parts) ** 2))
    if not long or variance == 0.0:
        return 1.0
    rough = np.concatenate([np.convolve(part, weights, "valid") for part in long])
    most = 1.0 + ONE_SIDED_95 * SHARE_SCATTER / math.sqrt(len(rough))
    return min(1.0, most * float(np.mean(rough**2)) / (of_unit_noise * variance))


def ar1_coefficient(parts: Sequence[Floats]) -> Floats:
    """Estimate the coefficient of one AR(1) process in stretches of data.

    Parameters
    ----------
    parts : sequence of (n,) or (n, k) ndarray
        Stretches with mean zero, along the first axis; k data sets at a time.

    Returns
    -------
    () or (k,) ndarray
        φ, corrected for the bias that subtracting the means causes, and clipped to [0, `LARGEST_PHI`].
    """
    total = sum(np.sum(e**2, axis=0) for e in parts)
    lagged = sum(np.sum(e[1:] * e[:-1], axis=0) for e in parts)
    length = sum(len(e) - 1 for e in parts) / len(parts) + 1.0
    raw = lagged / np.maximum(total, 1e-300) * length / (length - 1.0)
    return np.clip((raw * length + 1.0) / (length - 3.0) if length > 6 else raw, 0.0, LARGEST_PHI)
