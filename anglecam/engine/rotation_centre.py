"""The centre that the free poses of a body share: it stands still, or another body carries it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from anglecam.data.typing import Floats
from anglecam.engine.free_pose import FreePose
from anglecam.engine.score import carried_by
from anglecam.engine.target import rotations


@dataclass(frozen=True)
class RotationCentre:
    """A centre, and the turns about it that are nearest to free poses."""

    centre: Floats
    """(2,) px, in the coordinates of what carries it."""
    covariance: Floats
    """(2, 2) px²."""
    turn: Floats
    """(n,) rad."""
    off_px: float
    """Usual distance of the poses from such turns, as far as they show it, px."""


def common_centre(poses: Sequence[FreePose], start: Floats, middle: Floats, carriers: Floats) -> RotationCentre:
    """Fit one centre of rotation to free poses: one that stands still, or one that another body carries.

    What carries the centre C maps a place x to R₁x + t₁; what stands still, to x. A body that turns by θ about C, and
    that was taken for s₀ off, displaces its middle m by s = R₁(C + s₀) + t₁ + R(θ)(m − C) − m.

    The covariance has two terms. Errors that are independent from frame to frame show in how far the poses are from
    turns about one centre. Errors of a part of the body, as its depth or its appearance, are alike in like frames and
    show in how much the parts contradict each other in all frames (the sandwich estimate, clustered by parts: Liang and
    Zeger, Biometrika 73, 1986).

    Parameters
    ----------
    poses : sequence of FreePose
        n poses.
    start, middle : ndarray
        (2,) first guess of the centre, and middle of the body, px.
    carriers : ndarray
        (n, 2, 3) poses of what carries the centre: the unit matrix and no shift where it stands still.
    """
    q, information = np.array([one.q for one in poses]), np.array([one.information for one in poses])
    pulls = np.array([one.pulls for one in poses])
    pivot, shift = np.asarray(start, float), np.zeros(2)  # the pivot in the coordinates of the body
    arm_px = max(1.0, float(np.hypot(*(middle - pivot))))
    turn = q[:, 0].copy()
    normal, scale = np.eye(4), 1.0
    for step in range(12):
        place = carried_by(carriers, pivot) + carriers[:, :, :2] @ shift
        turn = _nearest(q, information, turn, pivot, place, middle)
        rotation, slope = rotations(turn)
        arm = middle - pivot
        off = q - np.column_stack([turn, place + rotation @ arm - arm])
        chi2 = np.einsum("ni,nij,nj->n", off, information, off)
        scale = max(1.0, float(np.median(chi2)))
        weighted = information * np.minimum(1.0, 3.0 / np.sqrt(np.maximum(chi2 / scale, 1e-9)))[:, None, None]
        by_turn = np.concatenate([np.ones((len(q), 1)), slope @ arm], axis=1)
        by_rest = np.zeros((len(q), 3, 4))
        by_rest[:, 1:, :2] = carriers[:, :, :2]
        by_rest[:, 1:, 2:] = carriers[:, :, :2] - rotation
        of_turn = np.einsum("ni,nij,nj->n", by_turn, weighted, by_turn)
        mixed = np.einsum("ni,nij,njk->nk", by_turn, weighted, by_rest)
        force_turn = np.einsum("ni,nij,nj->n", by_turn, weighted, off) / of_turn
        normal = np.einsum("nji,njk,nkl->il", by_rest, weighted, by_rest) - (mixed / of_turn[:, None]).T @ mixed
        force = np.einsum("nji,njk,nk->i", by_rest, weighted, off) - mixed.T @ force_turn
        ridge = 1e-9 * np.trace(normal) * np.eye(4)
        change = np.linalg.solve(normal + ridge, force)
        length = float(np.hypot(*change[2:]))
        change *= min(1.0, 0.5 * arm_px / max(length, 1e-9))
        shift, pivot = shift + change[:2], pivot + change[2:]
        if step > 2 and length < 0.01:
            break
    to_centre = np.hstack([np.eye(2), np.eye(2)])
    inverse = np.linalg.pinv(normal)
    weight = weighted[:, 1, 1] / information[:, 1, 1]
    at_rest = by_rest - by_turn[:, :, None] * (mixed / of_turn[:, None])[:, None, :]
    pull = np.einsum("n,npi,nij->pj", weight, pulls, at_rest)
    by_parts = pull.T @ pull * len(pull) / (len(pull) - 1)
    covariance = to_centre @ (scale * inverse + inverse @ by_parts @ inverse) @ to_centre.T
    place = carried_by(carriers, pivot) + carriers[:, :, :2] @ shift
    turn = _nearest(q, information, turn, pivot, place, middle)
    arm = middle - pivot
    off = q - np.column_stack([turn, place + rotations(turn)[0] @ arm - arm])
    # what a pose does not show, as a ball its own turn, does not count
    seen = np.einsum("ni,nij,nj->n", off, information, off) / np.trace(information[:, 1:, 1:], axis1=1, axis2=2)
    # the median squared distance in the plane is 2 ln 2 times the variance of either coordinate
    off_px = float(np.sqrt(2.0 * np.median(seen) / np.log(2.0)))
    return RotationCentre(pivot + shift, covariance, turn, off_px)


def _nearest(q: Floats, information: Floats, turn: Floats, pivot: Floats, shifts: Floats, middle: Floats) -> Floats:
    """Return the turns about a pivot, shifted by (n, 2), that are nearest to free poses in the metric of these."""
    arm = middle - pivot
    for _ in range(3):
        rotation, slope = rotations(turn)
        off = q - np.column_stack([turn, shifts + rotation @ arm - arm])
        tangent = np.concatenate([np.ones((len(q), 1)), slope @ arm], axis=1)
        along = np.einsum("ni,nij->nj", tangent, information)
        step = np.einsum("ni,ni->n", along, off) / np.maximum(np.einsum("ni,ni->n", along, tangent), 1e-12)
        turn = turn + np.clip(step, -0.5, 0.5)
    return turn
