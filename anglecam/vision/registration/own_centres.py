"""Whether the tiles of a body rotate about centres of their own, after a common centre was learnt.

In perspective, parts at different depths have their centres on one line, the image of the axis. Every other deviation
of a tile, by noise, codec, light or lens, is not tied to that line. So each tile gets a centre of its own, and its
displacement along the line is compared with that across it, tile by tile, by Wilcoxon's signed-rank test (Wilcoxon
1945). It assumes no distribution of the deviations.
"""

from __future__ import annotations

import numpy as np

from anglecam.data.typing import Floats
from anglecam.vision.image.transforms import rotation

_ERROR_RATE = 0.01
"""Share of bodies with a common centre that are taken for deep. The two mistakes do not cost the same: such a body is
learnt with heights near zero, and its angle is only less certain; a deep body with a common centre gets a wrong
angle."""
_REWEIGHTINGS = 20


def have_own_centres(normal: Floats, gradient: Floats, turns: Floats, arms_px: Floats, parallax: Floats) -> bool:
    """Return whether the tiles' centres scatter along the image of the axis more than across it.

    While one centre is common to all, the angles' scale gives way to the tiles' displacements. These then contain the
    tiles' arms times an error of the scale. Heights act along the axis alone, so the part across it determines that
    error.

    Parameters
    ----------
    normal, gradient : ndarray
        (tiles, frames, 5, 5) and (tiles, frames, 5) from `TileFit`, divided by the variances, where angles and common
        centre have converged.
    turns : ndarray
        (frames,) rad.
    arms_px : ndarray
        (tiles, 2) from the common centre to the tiles, px.
    parallax : ndarray
        (2,) along the image of the axis.
    """
    unit = parallax / np.hypot(*parallax)
    axes = np.array([[unit[0], -unit[1]], [unit[1], unit[0]]])
    found, spread = displacements_of_centres(normal, gradient, turns, axes)
    known = np.isfinite(spread).all(axis=1)
    (along, across), (s_along, s_across), arms = found[known].T, spread[known].T, (arms_px @ axes)[known]
    one = np.ones(len(arms))
    scale, shift = _least_absolute(np.stack([arms[:, 1], one], axis=1) / s_across[:, None], across / s_across)
    across = (across - scale * arms[:, 1] - shift) / s_across
    along = along - scale * arms[:, 0]
    along = (along - _least_absolute((one / s_along)[:, None], along / s_along)) / s_along
    return _signed_rank_p(np.abs(along) - np.abs(across)) < _ERROR_RATE


def displacements_of_centres(normal: Floats, gradient: Floats, turns: Floats, axes: Floats) -> tuple[Floats, Floats]:
    """Return (tiles, 2) displacement of each tile's centre along ``axes`` (columns), and its uncertainty by noise, px.

    A constant displacement of a tile is part of its appearance and is eliminated. The uncertainty of a tile that shows
    nothing is infinite.
    """
    displacement = (np.eye(2) - rotation(turns)) @ axes
    place, score = normal[..., 1:3, 1:3], gradient[..., 1:3]
    own = np.einsum("kai,tkab,kbj->tij", displacement, place, displacement)
    cross = np.einsum("kai,tkab->tib", displacement, place)
    eliminated = cross @ np.linalg.pinv(place.sum(axis=1), hermitian=True)
    information = own - eliminated @ cross.transpose(0, 2, 1)
    right = np.einsum("kai,tka->ti", displacement, score) - np.einsum("tib,tb->ti", eliminated, score.sum(axis=1))
    covariance = np.linalg.pinv(information, hermitian=True)
    variance = np.einsum("tii->ti", covariance)
    return np.einsum("tij,tj->ti", covariance, right), np.sqrt(np.where(variance > 0.0, variance, np.inf))


def _least_absolute(columns: Floats, values: Floats) -> Floats:
    """Return the factors of the columns with the least sum of absolute residuals, by reweighted least squares."""
    weight = np.ones(len(values))
    for _ in range(_REWEIGHTINGS):
        root = np.sqrt(weight)
        factors = np.linalg.lstsq(columns * root[:, None], values * root, rcond=None)[0]
        weight = 1.0 / np.maximum(np.abs(values - columns @ factors), 1.0)  # below the noise all count the same
    return np.asarray(factors, dtype=float)


def _signed_rank_p(differences: Floats) -> float:
    """Return the probability that differences symmetrical about zero have so large a sum of positive ranks.

    Every rank is positive or not with equal probability, so the sum's distribution is the convolution of all ranks.
    """
    ranks = np.argsort(np.argsort(np.abs(differences))) + 1
    reached = int(ranks[differences > 0.0].sum())
    ways = np.ones(1)
    for rank in range(1, len(ranks) + 1):
        ways = (np.append(ways, np.zeros(rank)) + np.append(np.zeros(rank), ways)) / 2.0
    return float(ways[reached:].sum())
