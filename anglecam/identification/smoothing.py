"""Fixed-interval smoothing: the state of every frame given all data, not only the data before it.

The filter's estimate x, P of a frame is combined with the information of later frames (Fraser and Potter, IEEE Trans.
Autom. Control 14, 1969). It is accumulated backwards as information Λ, λ on the error of x, with innovation y and gain
K:

    before a frame's measurement   λ ← λ + (ΛK + Hᵀ/r)·y         Λ ← Λ + HᵀH/r
    back to the frame before       λ ← Fᵀ(1 + ΛQ)⁻¹λ             Λ ← Fᵀ(1 + ΛQ)⁻¹ΛF
    smoothed                       P ← (P⁻¹ + Λ)⁻¹               x ← x + Pλ

The result equals that of Rauch, Tung and Striebel. Their gain is F⁻¹ where Q = 0: it would run a damped plant backwards
in time, and of a motion that decays by e⁻¹⁰⁰ nothing but rounding would be left. Information decays with the motion. In
addition, a covariance far smaller than the filter's, as in the first frames, is not computed as the difference of two
large ones.

The step from a recording to the recording before has the same form: F keeps only the parameters, and Q is the
covariance of the first state.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from anglecam.data.typing import Floats
from anglecam.identification.kalman import SHARED, Filtered, observation_matrix


@dataclass(frozen=True)
class Smoothed:
    """States of a recording given all frames of all recordings."""

    state: Floats
    """(n, s) θ (rad), θ̇ (rad/s), a (1/s), b (1/s²), c (1/s²) and perhaps the zero (rad)."""
    covariance: Floats
    """(n, s, s), SI."""


def smooth(passed: Sequence[Filtered]) -> tuple[Smoothed, ...]:
    """Smooth recordings that were filtered one after another.

    Parameters
    ----------
    passed : sequence of Filtered
        In the order in which the filter passed through them.

    Returns
    -------
    tuple of Smoothed
        One for each recording.
    """
    result = []
    for one, later in zip(passed, _later_frames(passed), strict=True):
        covariance = np.array(
            [_combined(P, information) for P, (information, _) in zip(one.covariance, later, strict=True)]
        )
        moved = [P @ vector for P, (_, vector) in zip(covariance, later, strict=True)]
        result.append(Smoothed(one.state + np.array(moved), covariance))
    return tuple(result)


def smooth_first_states(passed: Sequence[Filtered]) -> tuple[Floats, ...]:
    """Return only each recording's (s,) smoothed state at its first frame."""
    firsts = [later[0] for later in _later_frames(passed)]
    return tuple(
        one.state[0] + _combined(one.covariance[0], information) @ vector
        for one, (information, vector) in zip(passed, firsts, strict=True)
    )


def _later_frames(passed: Sequence[Filtered]) -> list[list[tuple[Floats, Floats]]]:
    """Return, for each frame of each recording, the information Λ, λ of all later frames on its filtered state."""
    result = []
    shared_information, shared_vector = np.zeros((3, 3)), np.zeros(3)
    for one in reversed(passed):
        n, s = one.state.shape
        H, r = observation_matrix(s)[0], one.measurement_variance
        weight, towards = np.outer(H, H) / r, H / r
        information, vector = np.zeros((s, s)), np.zeros(s)
        information[SHARED, SHARED], vector[SHARED] = shared_information, shared_vector
        later = []
        for i in range(n - 1, -1, -1):
            later.append((information, vector))
            vector = vector + (information @ one.gain[i] + towards) * one.innovation[i]
            information = information + weight
            F, Q = one.transition[i], one.process[i]
            back = F.T @ _inverse(np.eye(s) + information @ Q) if Q.any() else F.T
            information, vector = back @ information @ F, back @ vector
            information = 0.5 * (information + information.T)
        shared_information, shared_vector = information[SHARED, SHARED], vector[SHARED]
        result.append(later[::-1])
    return result[::-1]


def _inverse(matrix: Floats) -> Floats:
    """Return the inverse; NaN where a diverging pass has left nothing of the 1 in 1 + ΛQ."""
    try:
        return np.asarray(np.linalg.inv(matrix), dtype=np.float64)
    except np.linalg.LinAlgError:
        return np.full_like(matrix, np.nan)


def _combined(covariance: Floats, information: Floats) -> Floats:
    """Return (P⁻¹ + Λ)⁻¹ = R(1 + RᵀΛR)⁻¹Rᵀ with P = RRᵀ, for a P that may be singular."""
    scale = np.sqrt(np.maximum(np.diag(covariance), 0.0))  # at rest the variance of the rate is 0 ± rounding
    divisor = np.where(scale > 0.0, scale, 1.0)
    with np.errstate(all="ignore"):
        relative = covariance / np.outer(divisor, divisor)
    if not (np.all(np.isfinite(relative)) and np.all(np.isfinite(information))):
        return np.full_like(covariance, np.nan)
    values, vectors = np.linalg.eigh(relative)
    root = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    # after a diverging pass rounding may leave eigenvalues below 1; the caller rejects such a pass by its cost
    precision, axes = np.linalg.eigh(np.eye(len(root)) + root.T @ information @ root)
    half = root @ axes / np.sqrt(np.maximum(precision, 1.0))
    return half @ half.T
