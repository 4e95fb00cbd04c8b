"""Normal equations of a body's tiles for the centre of rotation and the tiles' heights.

A rotated tile appears displaced by t = (1 − R)·(e + p·h), with the error e of the pivot, the parallax p and the tile's
height h. Every frame's angle is free and is eliminated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats
from anglecam.vision.image.transforms import rotation

NO_INFORMATION = 1e-9
"""Information of a frame in which every tile is hidden."""


@dataclass(frozen=True)
class CentrePrior:
    """Prior information on the centres of rotation, 1/px²."""

    pivot: Floats
    """(2, 2)."""
    height: float


@dataclass(frozen=True)
class CentreEquations:
    """Normal equations for the errors of pivot and heights (size 2 or 2 + tiles), every frame's angle eliminated."""

    information: Floats
    """(size, size)."""
    scores: Floats
    """(tiles, size)."""
    cross: Floats
    """(frames, size) cross terms with each frame's angle."""
    turn_information: Floats
    """(frames,) information on the angle."""
    turn_scores: Floats
    """(frames,) score of the angle."""


def centre_equations(normal: Floats, gradient: Floats, turns: Floats, parallax: Floats) -> CentreEquations:
    """Assemble the normal equations. Without parallax the heights have no effect and are left out.

    Parameters
    ----------
    normal, gradient : ndarray
        (tiles, frames, 3, 3) and (tiles, frames, 3) for angle, x and y, divided by the variances.
    turns : ndarray
        (frames,) rad.
    parallax : ndarray
        (2,) displacement of the centre of rotation for each px of height.

    Returns
    -------
    CentreEquations
        Of size 2, or 2 + tiles with parallax.
    """
    displacement = np.eye(2) - rotation(turns)
    place = np.einsum("kai,tkab,kbj->tij", displacement, normal[..., 1:, 1:], displacement)
    cross_place = np.einsum("kai,tka->tki", displacement, normal[..., 1:, 0])
    score = np.einsum("kai,tka->ti", displacement, gradient[..., 1:])
    turn_information, tiles = np.maximum(normal[..., 0, 0].sum(axis=0), NO_INFORMATION), len(normal)
    size = 2 + (tiles if parallax.any() else 0)
    information, scores, cross = np.zeros((size, size)), np.zeros((tiles, size)), np.zeros((len(turns), size))
    information[:2, :2], scores[:, :2], cross[:, :2] = place.sum(axis=0), score, cross_place.sum(axis=0)
    if size > 2:
        place_height = place @ parallax
        information[2:, :2], information[:2, 2:] = place_height, place_height.T
        information[2:, 2:] = np.diag(place_height @ parallax)
        scores[:, 2:] = np.diag(score @ parallax)
        cross[:, 2:] = (cross_place @ parallax).T
    information -= (cross.T / turn_information) @ cross
    scores -= (gradient[..., 0] / turn_information) @ cross
    return CentreEquations(information, scores, cross, turn_information, gradient[..., 0].sum(axis=0))


def solve_centres(
    equations: CentreEquations, prior: CentrePrior, error: Floats, heights: Floats
) -> tuple[Floats, Floats]:
    """Solve for the steps of pivot and heights.

    Parameters
    ----------
    equations : CentreEquations
        From the data.
    prior : CentrePrior
        Prior information; the prior mean is zero for the error of the pivot and for the heights.
    error : ndarray
        (2,) current error of the pivot, px.
    heights : ndarray
        (tiles,) current heights, px.

    Returns
    -------
    step : ndarray
        (size,) px.
    covariance : ndarray
        (size, size) in units of the pixels' noise.
    """
    information, right = equations.information.copy(), equations.scores.sum(axis=0)
    information[:2, :2] += prior.pivot
    right[:2] -= prior.pivot @ error
    if len(information) > 2:
        information[2:, 2:] += prior.height * np.eye(len(heights))
        right[2:] -= prior.height * heights
    covariance = np.asarray(np.linalg.inv(information), dtype=float)
    return covariance @ right, covariance


def effective_centre(normal: Floats, parallax: Floats) -> Floats:
    """Return the matrix (2, size) from the errors of pivot and heights to the error of the effective centre.

    An error of the tiles' centres acts on a frame's angle through the sum over tiles of n·(1 − R)·(e + p·h), with the
    cross terms n of angle and place. As complex numbers, factors commute: the sum equals that of a common centre whose
    error is e + Σ conj(n)·p·h / Σ conj(n), in every frame.
    """
    if not parallax.any():
        return np.eye(2)
    cross = normal[..., 0, 1:].sum(axis=1)
    against = cross[:, 0] - 1j * cross[:, 1]
    share = against / against.sum() * (parallax[0] + 1j * parallax[1])
    return np.hstack([np.eye(2), np.stack([share.real, share.imag])])


def disagreement_of_groups(covariance: Floats, scores: Floats, groups: NDArray[np.intp]) -> float:
    """Return the pivot's variance from the disagreement of groups of tiles over that expected from noise alone.

    The cluster-robust sandwich (Liang & Zeger 1986), with one cluster for each group.
    """
    names = np.unique(groups)
    influence = np.stack([scores[groups == group].sum(axis=0) for group in names]) @ covariance
    variance = float((influence[:, :2] ** 2).sum()) * len(names) / max(len(names) - 2, 1)
    return variance / float(np.trace(covariance[:2, :2]))


def excess_displacement(normal: Floats, gradient: Floats) -> float:
    """Return the mean square of the displacement that a body on a fixed pivot cannot have, in units of its noise."""
    seen = normal[:, 0, 0] > NO_INFORMATION
    normal, gradient = normal[seen], gradient[seen]
    place = normal[:, 1:, 1:] - normal[:, 1:, :1] * normal[:, :1, 1:] / normal[:, :1, :1]
    shift = gradient[:, 1:] - normal[:, 1:, 0] * (gradient[:, :1] / normal[:, :1, 0])
    return float(np.einsum("ni,nij,nj->n", shift, np.linalg.pinv(place, hermitian=True), shift).mean() / 2.0)
