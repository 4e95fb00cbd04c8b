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

_ERROR_RATE = 1e-3
"""Share of bodies with a common centre that are taken for deep. Such a body is learnt with heights near zero: its angle
is not wrong, only less certain."""


def have_own_centres(normal: Floats, gradient: Floats, turns: Floats, parallax: Floats) -> bool:
    """Return whether the tiles' centres scatter along the image of the axis more than across it.

    Parameters
    ----------
    normal, gradient : ndarray
        (tiles, frames, 5, 5) and (tiles, frames, 5) from `TileFit`, divided by the variances, where angles and common
        centre have converged.
    turns : ndarray
        (frames,) rad.
    parallax : ndarray
        (2,) along the image of the axis.
    """
    along, across = np.abs(displacements_of_centres(normal, gradient, turns, parallax)).T
    return _signed_rank_p(along - across) < _ERROR_RATE


def displacements_of_centres(normal: Floats, gradient: Floats, turns: Floats, parallax: Floats) -> Floats:
    """Return (tiles, 2) displacement of each tile's centre along and across the axis, in standard deviations of noise.

    A constant displacement of a tile is part of its appearance and is eliminated.
    """
    unit = parallax / np.hypot(*parallax)
    axes = np.array([[unit[0], -unit[1]], [unit[1], unit[0]]])
    displacement = (np.eye(2) - rotation(turns)) @ axes
    place, score = normal[..., 1:3, 1:3], gradient[..., 1:3]
    own = np.einsum("kai,tkab,kbj->tij", displacement, place, displacement)
    cross = np.einsum("kai,tkab->tib", displacement, place)
    eliminated = cross @ np.linalg.pinv(place.sum(axis=1), hermitian=True)
    information = own - eliminated @ cross.transpose(0, 2, 1)
    right = np.einsum("kai,tka->ti", displacement, score) - np.einsum("tib,tb->ti", eliminated, score.sum(axis=1))
    covariance = np.linalg.pinv(information, hermitian=True)
    spread = np.sqrt(np.maximum(np.einsum("tii->ti", covariance), 0.0))
    found = np.einsum("tij,tj->ti", covariance, right)
    return np.divide(found, spread, out=np.zeros_like(found), where=spread > 0.0)


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
