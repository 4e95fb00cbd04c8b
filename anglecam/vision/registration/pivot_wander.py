"""How far a body's pivot wanders from frame to frame, from displacements that no rotation about a fixed pivot explains.

A hand that holds the camera before a blank wall displaces the whole picture, and nothing but the body shows it. All
tiles are then displaced alike in a frame, by more than their disagreement allows. The displacement of each frame is a
random effect (Laird and Ware, Biometrics 38, 1982). Its variance maximises the likelihood.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize_scalar

from anglecam.data.typing import Floats
from anglecam.vision.registration.centre_equations import NO_INFORMATION

_LEAST_GAIN = 10.8
"""Twice the logarithm of the likelihood ratio from which on a wandering pivot is believed: the 0.1 % point of χ² with
one degree of freedom, so that a pivot at rest is taken for a wandering one in less than 0.1 % of the films."""
_FINEST, _WIDEST = 1e-4, 30.0
"""Standard deviations between which the wander is sought, px."""
_LEAST = 0.125
"""Standard deviation below which it is no wander but noise, px. Codecs predict motion to a quarter of a pixel, and what
is learnt is interpolated. Such errors displace the tiles alike, too, but they also rotate them."""


def pivot_wander(normal: Floats, gradient: Floats, birge2: float) -> float:
    """Return the standard deviation of a frame's pivot along each axis, px; 0 where a fixed pivot fits as well.

    Parameters
    ----------
    normal, gradient : ndarray
        (frames, 3, 3) and (frames, 3), at least, for turn and place of all tiles, divided by the variances.
    birge2 : float
        Square of the tiles' scatter over that expected from noise; at least 1.

    Returns
    -------
    float
        px.
    """
    information, score = beside_turn(normal, gradient)
    along, axes = np.linalg.eigh(information)
    parts = np.einsum("nij,ni->nj", axes, score)
    seen = along > NO_INFORMATION
    precision, square = along[seen], parts[seen] ** 2 / along[seen]

    def deviance(log_wander: float) -> float:
        variance = birge2 + np.exp(2.0 * log_wander) * precision
        return float((np.log(variance) + square / variance).sum())

    if not len(precision):
        return 0.0
    best = minimize_scalar(deviance, bounds=(np.log(_FINEST), np.log(_WIDEST)), method="bounded")
    at_rest = float((np.log(birge2) + square / birge2).sum())
    wander = float(np.exp(best.x))
    return wander if wander >= _LEAST and at_rest - best.fun > _LEAST_GAIN else 0.0


def excess_displacement(normal: Floats, gradient: Floats) -> float:
    """Return the mean square of the displacement that a body on a fixed pivot cannot have, in units of its noise."""
    information, score = beside_turn(normal, gradient)
    return float(np.einsum("ni,nij,nj->n", score, np.linalg.pinv(information, hermitian=True), score).mean() / 2.0)


def frame_displacements(normal: Floats, gradient: Floats, birge2: float, wander: float) -> Floats:
    """Return (n, 2) the likeliest displacement of the body in each frame, in its own coordinates, px.

    ``wander`` is its standard deviation along each axis, px.
    """
    found = np.zeros((len(normal), 2))
    information, score = beside_turn(normal, gradient)
    posterior = np.linalg.inv(information / birge2 + np.eye(2) / wander**2)
    found[normal[:, 0, 0] > NO_INFORMATION] = np.einsum("nij,nj->ni", posterior, score / birge2)
    return found


def beside_turn(normal: Floats, gradient: Floats) -> tuple[Floats, Floats]:
    """Return the information (n, 2, 2) and score (n, 2) of each frame's place, its turn eliminated."""
    seen = normal[:, 0, 0] > NO_INFORMATION
    normal, gradient = normal[seen], gradient[seen]
    information = normal[:, 1:3, 1:3] - normal[:, 1:3, :1] * normal[:, :1, 1:3] / normal[:, :1, :1]
    return information, gradient[:, 1:3] - normal[:, 1:3, 0] * (gradient[:, :1] / normal[:, :1, 0])
