"""Normal equations of a body's tiles for the centre of rotation and the tiles' heights.

A rotated tile appears displaced by t = (1 − R)·(e + (p + φ·p')·h), with the error e of the pivot, the parallax p, its
error of direction φ (p' is p turned by a right angle), and the tile's height h, which may vary over the tile. Every
frame's angle is free and is eliminated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats
from anglecam.vision.image.transforms import rotation
from anglecam.vision.registration.axis_view import AxisView

NO_INFORMATION = 1e-9
"""Information of a frame in which every tile is hidden."""


@dataclass(frozen=True)
class Centres:
    """All that determines about which image points the tiles rotate, or a step or an error of it."""

    values: Floats
    """(3 + 3·tiles,) pivot (px), direction of the parallax (rad), heights (px), and leans x and y of every tile."""

    @property
    def pivot(self) -> Floats:
        """(2,) px."""
        return self.values[PIVOT]

    @property
    def direction(self) -> float:
        """Of the parallax, rad."""
        return float(self.values[DIRECTION])

    @property
    def heights(self) -> Floats:
        """(tiles,) px."""
        return self.values[heights_of(len(self.values))]

    @property
    def leans(self) -> Floats:
        """(tiles, 2) gradients of the height."""
        return self.values[leans_of(len(self.values))].reshape(-1, 2)


PIVOT, DIRECTION = slice(0, 2), 2
"""Places of pivot and direction among the unknowns."""


def heights_of(size: int) -> slice:
    """Return the places of the heights among ``size`` unknowns."""
    return slice(3, 3 + (size - 3) // 3)


def leans_of(size: int) -> slice:
    """Return the places of the leans among ``size`` unknowns."""
    return slice(3 + (size - 3) // 3, size)


@dataclass(frozen=True)
class CentreEquations:
    """Normal equations for the errors of the free unknowns, every frame's angle eliminated."""

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


def centre_equations(normal: Floats, gradient: Floats, turns: Floats, by_unknown: Floats) -> CentreEquations:
    """Assemble the normal equations.

    Parameters
    ----------
    normal, gradient : ndarray
        (tiles, frames, 5, 5) and (tiles, frames, 5) from `TileFit`, divided by the variances.
    turns : ndarray
        (frames,) rad.
    by_unknown : ndarray
        (tiles, 4, size) from `centre_derivatives`, of the unknowns that are free.

    Returns
    -------
    CentreEquations
        Linear in the steps of the free unknowns.
    """
    displacement = _displacements(turns)
    place = np.einsum("kai,tkab,kbj->tij", displacement, normal[..., 1:, 1:], displacement)
    cross_place = np.einsum("kai,tka->tki", displacement, normal[..., 1:, 0])
    score = np.einsum("kai,tka->ti", displacement, gradient[..., 1:])
    turn_information = np.maximum(normal[..., 0, 0].sum(axis=0), NO_INFORMATION)
    information = np.einsum("tiu,tij,tjv->uv", by_unknown, place, by_unknown, optimize=True)
    scores = np.einsum("ti,tiu->tu", score, by_unknown)
    cross = np.einsum("tki,tiu->ku", cross_place, by_unknown)
    information -= (cross.T / turn_information) @ cross
    scores -= (gradient[..., 0] / turn_information) @ cross
    return CentreEquations(information, scores, cross, turn_information, gradient[..., 0].sum(axis=0))


def centre_derivatives(axis: AxisView, heights: Floats) -> Floats:
    """Return (tiles, 4, size) the derivatives of the tiles' centres (x, y) and leans (x, y) by the unknowns."""
    tiles = len(heights)
    each = np.arange(tiles)
    derivatives = np.zeros((tiles, 4, 3 + 3 * tiles))
    derivatives[:, :2, PIVOT] = np.eye(2)
    derivatives[:, :2, DIRECTION] = heights[:, None] * axis.aside
    derivatives[each, :2, 3 + each] = axis.parallax
    for k in range(2):
        derivatives[each, 2 + k, 3 + tiles + 2 * each + k] = 1.0
    return derivatives


def solve_centres(equations: CentreEquations, prior: Floats, error: Floats) -> tuple[Floats, Floats]:
    """Solve for the steps of the free unknowns.

    Parameters
    ----------
    equations : CentreEquations
        From the data.
    prior : ndarray
        (size, size) prior information; the prior mean is zero for all.
    error : ndarray
        (size,) current values.

    Returns
    -------
    step : ndarray
        (size,).
    covariance : ndarray
        (size, size) in units of the pixels' noise.
    """
    covariance = np.asarray(np.linalg.inv(equations.information + prior), dtype=float)
    return covariance @ (equations.scores.sum(axis=0) - prior @ error), covariance


def _displacements(turns: Floats) -> Floats:
    """Return (frames, 4, 4) the derivatives of the displacement by centre and lean."""
    displacement = np.tile(np.eye(4), (len(turns), 1, 1))
    displacement[:, :2, :2] -= rotation(turns)
    return displacement


def remaining_gradient(
    normal: Floats, gradient: Floats, turns: Floats, by_unknown: Floats, step: Floats, turn_steps: Floats
) -> Floats:
    """Return the gradient (tiles, frames, 5) after a step of the unknowns (size,) and of the turns (frames,), rad."""
    place = np.einsum("kai,tiu,u->tka", _displacements(turns), by_unknown, step, optimize=True)
    whole = np.concatenate([np.broadcast_to(turn_steps[:, None], (*place.shape[:2], 1)), place], axis=2)
    return np.asarray(gradient - np.einsum("tkab,tkb->tka", normal, whole))


def displacement_scatter(normal: Floats, gradient: Floats, variance: Floats) -> Floats:
    """Return each tile's mean square of its displacements over frames, in units of the noise.

    Parameters
    ----------
    normal, gradient : ndarray
        (tiles, frames, 5, 5) and (tiles, frames, 5) from `TileFit`.
    variance : ndarray
        (tiles,) of the pixels' noise.

    Returns
    -------
    ndarray
        (tiles,): 1 for a tile whose errors are those of the noise alone.
    """
    place, score = normal[..., 1:3, 1:3], gradient[..., 1:3]
    square = np.einsum("tka,tkab,tkb->tk", score, np.linalg.pinv(place, hermitian=True), score) / 2.0
    seen = normal[..., 0, 0] > NO_INFORMATION
    return np.asarray((square * seen).sum(axis=1) / np.maximum(seen.sum(axis=1), 1) / variance)


def effective_centre(normal: Floats, by_unknown: Floats) -> Floats:
    """Return the matrix (2, size) from the errors of the free unknowns to the error of the effective centre.

    Errors d of the tiles' centres act on a frame's angle through the sum over tiles of n·(1 − R)·d, with the cross
    terms n of angle and place. As complex numbers, factors commute: the sum equals that of a common centre whose error
    is Σ conj(n)·d / Σ conj(n), in every frame.
    """
    cross = normal[..., 0, 1:3].sum(axis=1)
    against = cross[:, 0] - 1j * cross[:, 1]
    share = (against / against.sum()) @ (by_unknown[:, 0] + 1j * by_unknown[:, 1])
    return np.stack([share.real, share.imag])


def group_scatter(normal: Floats, gradient: Floats, groups: NDArray[np.intp]) -> tuple[float, int]:
    """Return the sum of squares of the groups' departures from the common angle, in units of their noise.

    Neighbouring tiles share a codec's blocks and their errors are correlated, so only groups are independent.

    Parameters
    ----------
    normal, gradient : ndarray
        (tiles, frames, 3, 3) and (tiles, frames, 3), divided by the variances.
    groups : ndarray
        (tiles,) group of each tile.

    Returns
    -------
    total : float
        Sum over groups and frames.
    count : int
        Number of terms.
    """
    belongs = (groups == np.arange(groups.max() + 1)[:, None]).astype(float)
    information, score = belongs @ normal[..., 0, 0], belongs @ gradient[..., 0]
    seen = information > 0
    return float((score[seen] ** 2 / information[seen]).sum()), int(seen.sum())


def fitted_terms(normal: Floats, groups: NDArray[np.intp], covariance: Floats) -> float:
    """Return by how much a fit lowers the expected sum of `group_scatter` of one frame.

    What is left of a group's gradient after the fit has the covariance N − N·P·N, with N its normal matrix and P the
    covariance of what was fitted. Where that is the turn alone, the terms are 1.

    Parameters
    ----------
    normal : ndarray
        (tiles, 3, 3) for turn and place, divided by the variances.
    groups : ndarray
        (tiles,) group of each tile.
    covariance : ndarray
        (3, 3) P; zero for what was not fitted.
    """
    of_turn = (groups == np.arange(groups.max() + 1)[:, None]).astype(float) @ normal[:, 0]
    seen = of_turn[of_turn[:, 0] > 0.0]
    return float((np.einsum("gi,ij,gj->g", seen, covariance, seen) / seen[:, 0]).sum())


def disagreement_of_groups(covariance: Floats, scores: Floats, groups: NDArray[np.intp], acting: Floats) -> float:
    """Return the effective centre's variance from the disagreement of groups of tiles over that expected from noise.

    The cluster-robust sandwich (Liang & Zeger 1986), with one cluster for each group. From ν degrees of freedom the
    centre has a t distribution, whose variance is ν/(ν − 2) times as large (GUM Supplement 1, 6.4.9.4).

    Parameters
    ----------
    covariance : ndarray
        (size, size) of the free unknowns.
    scores : ndarray
        (tiles, size).
    groups : ndarray
        (tiles,) group of each tile.
    acting : ndarray
        (2, size) from `effective_centre`.
    """
    names = np.unique(groups)
    influence = np.stack([scores[groups == group].sum(axis=0) for group in names]) @ covariance @ acting.T
    freedom = max(len(names) - 2, 1)
    variance = float((influence**2).sum()) * len(names) / max(freedom - 2, 1)
    return variance / float(np.trace(acting @ covariance @ acting.T))
