"""A pose of most likelihood: the turn of a body and the shift of its middle, and how well a frame shows them.

Where the likelihood is greatest, its curvature is the information matrix, also of a ball that shows no turn of its own,
or of a stick that may slide along itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anglecam.data.typing import Floats
from anglecam.engine.body import Body, Frame, poses_about

_STEPS_PX = (2.0, 1.0, 0.5)
"""Steps of the difference quotients: a pose may begin some pixels off."""
_LEAST_INFORMATION = 1e-4
"""1/px²: a place that nothing shows is uncertain by 100 px."""


@dataclass(frozen=True)
class FreePose:
    """Of a body in one frame: the turn, rad, and the shift of the body's middle, px."""

    q: Floats
    """(3,) where the likelihood is greatest."""
    information: Floats
    """(3, 3) inverse covariance if pixels were independent."""
    pulls: Floats
    """(parts, 3) slope of the log likelihood of each part there; they add up to nothing."""


def free_pose(frame: Frame, body: Body, start: Floats) -> FreePose:
    """Return the pose of most likelihood near a first guess (2, 3). A quadratic function approximates the gain."""
    units = np.array([1.0 / body.reach, 1.0, 1.0])
    q, curvature = _as_parameters(start, body), np.zeros((3, 3))
    for h in _STEPS_PX:
        for _ in range(2):
            points = q + h * _STENCIL * units
            gains = body.gains(frame, _poses(points, body)).sum(axis=1)
            slope, curvature = _quadratic(gains, h)
            values, axes = np.linalg.eigh(curvature)
            along = axes.T @ slope
            steps = np.where(values < 0.0, along / np.maximum(-values, 1e-9), 2.0 * h * np.sign(along))
            steps = axes @ np.clip(steps, -2.0 * h, 2.0 * h)
            trial = q + steps * units
            reached = float(body.gains(frame, _poses(trial[None], body)).sum())
            top = int(np.argmax(gains))
            if reached > gains[top]:
                moved, q = float(np.abs(steps).max()), trial
            else:
                moved, q = (h if top else 0.0), points[top]
            if moved < 0.5 * h:
                break
    values, axes = np.linalg.eigh(-curvature)
    information = (axes * np.maximum(values, _LEAST_INFORMATION)) @ axes.T
    h = _STEPS_PX[-1]
    beside = body.gains(frame, _poses(q + h * _STENCIL[1:7] * units, body))
    pulls = (beside[::2] - beside[1::2]).T / (2.0 * h)
    pulls -= pulls.mean(axis=0)
    return FreePose(q, information / np.outer(units, units), pulls / units)


_PAIRS = ((0, 1), (0, 2), (1, 2))
_STENCIL = np.array(
    [
        [0, 0, 0],
        *(sign * np.eye(3)[i] for i in range(3) for sign in (1, -1)),
        *(sign * (np.eye(3)[i] + np.eye(3)[j]) for i, j in _PAIRS for sign in (1, -1)),
    ],
    float,
)
"""(13, 3) points by which a quadratic function of three variables is found."""


def _quadratic(gains: Floats, h: float) -> tuple[Floats, Floats]:
    """Return gradient and curvature from the gains at the stencil's points."""
    above, below = gains[1:7:2], gains[2:7:2]
    slope = (above - below) / (2.0 * h)
    curvature = np.diag((above + below - 2.0 * gains[0]) / h**2)
    for (i, j), both, neither in zip(_PAIRS, gains[7::2], gains[8::2], strict=True):
        mixed = both + neither - above[i] - below[i] - above[j] - below[j] + 2.0 * gains[0]
        curvature[i, j] = curvature[j, i] = mixed / (2.0 * h**2)
    return slope, curvature


def _poses(q: Floats, body: Body) -> Floats:
    return poses_about(body.middle, q[:, 0], q[:, 1:])


def _as_parameters(pose: Floats, body: Body) -> Floats:
    turn = np.arctan2(pose[0, 1], pose[0, 0])
    return np.array([turn, *(pose[:, :2] @ body.middle + pose[:, 2] - body.middle)])
