"""Which of several models holds in each frame, where a recording changes from one to another at unknown times.

From one frame to the next the model stays with probability 1 − ρ; else every model is equally likely. Forward and
backward pass (Rabiner, Proc. IEEE 77, 1989) give each model's probability in each frame. ρ is the one of `RATES` with
the largest likelihood.
"""

from __future__ import annotations

import numpy as np
from numba import njit, types

from anglecam.data.typing import Floats
from anglecam.models.array_types import MATRIX, READ_MATRIX

RATES = tuple(10.0**k for k in range(-6, 0))
"""Probabilities of a change between two frames that are tried: from never in a recording to every tenth frame."""


def model_probabilities(log_likelihoods: Floats) -> Floats:
    """Return (n, c) probabilities of c models in n frames, from (n, c) ``log_likelihoods`` of the frames alone.

    Examples
    --------
    The first model explains the first half, the second model the second half.

    >>> log_likelihoods = np.repeat([[0.0, -2.0], [-2.0, 0.0]], 10, axis=0)
    >>> np.round(model_probabilities(log_likelihoods)[[0, -1]]).tolist()
    [[1.0, 0.0], [0.0, 1.0]]
    """
    # the largest of each frame is set to 1, which changes no probability and all likelihoods alike
    likelihoods = np.exp(log_likelihoods - log_likelihoods.max(axis=1, keepdims=True))
    forward = np.empty_like(likelihoods)
    rate = max(RATES, key=lambda rate: _forward(likelihoods, rate, forward))
    _forward(likelihoods, rate, forward)
    _backward(likelihoods, rate, forward)
    return forward


@njit(types.float64(READ_MATRIX, types.float64, MATRIX), nogil=True, cache=True)
def _forward(likelihoods: Floats, rate: float, probabilities: Floats) -> float:
    """Write the probabilities given the frames up to each one, and return the log-likelihood of all."""
    n, c = likelihoods.shape
    total = 0.0
    for k in range(n):
        frame = 0.0
        for j in range(c):
            before = probabilities[k - 1, j] if k > 0 else 1.0 / c
            probabilities[k, j] = ((1.0 - rate) * before + rate / c) * likelihoods[k, j]
            frame += probabilities[k, j]
        probabilities[k] /= frame
        total += np.log(frame)
    return total


@njit(types.void(READ_MATRIX, types.float64, MATRIX), nogil=True, cache=True)
def _backward(likelihoods: Floats, rate: float, probabilities: Floats) -> None:
    """Turn the probabilities that `_forward` wrote into those given all frames."""
    n, c = likelihoods.shape
    later = np.ones(c)
    for k in range(n - 1, -1, -1):
        probabilities[k] *= later
        probabilities[k] /= probabilities[k].sum()
        later *= likelihoods[k]
        later = (1.0 - rate) * later + rate * later.mean()
        later /= later.sum()
