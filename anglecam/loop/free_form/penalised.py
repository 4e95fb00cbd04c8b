"""Penalised least squares of the residual on the responses to a curve: how smooth it is, and how well it predicts.

    minimise |y − A·β − R·α|² + λ·αᵀPα

y is the whitened residual, A the derivatives with respect to the plant's parameters, R the responses to each parameter
of the curve and P the curve's roughness, a sum of squared second differences (Eilers and Marx, Statist. Sci. 11, 1996).
λ maximises the restricted likelihood, in which α is a random effect (Patterson and Thompson, Biometrika 58, 1971;
Wood, J. R. Statist. Soc. B 73, 2011).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from anglecam.data.typing import Floats

SMOOTHEST, ROUGHEST, PER_DECADE = 6.0, -7.0, 4
"""Decades between which λ is searched, relative to the λ at which penalty and data count alike."""
RIDGE = 1e-9
"""Share of the mean curvature of the cost that is added to every parameter, for splines where no data are."""


def smoothing(
    response: Floats, left: Floats, roughness: Sequence[Floats], free: int, ratios: Sequence[float] = (1.0,)
) -> tuple[float, ...]:
    """Return the λ of each axis that maximise the restricted likelihood.

    Parameters
    ----------
    response : (N, m) ndarray
        R without the part that A can follow, rad per parameter.
    left : (N,) ndarray
        y without the part that A can follow, rad.
    roughness : sequence of (m, m) ndarray
        P for one or two axes.
    free : int
        N less the rank of A.
    ratios : sequence of float
        Ratios of the second λ to the first that are tried, relative to those at which both axes count alike.

    Returns
    -------
    tuple of float
        λ for each axis.
    """
    gram, along, energy = response.T @ response, response.T @ left, float(left @ left)
    if not np.any(gram):  # the other parameters can follow all that the curves do
        return tuple(1.0 for _ in roughness)
    gram = gram + RIDGE * np.trace(gram) / len(gram) * np.eye(len(gram))
    units = [float(np.trace(gram) / np.trace(one)) for one in roughness]
    rank = int(np.linalg.matrix_rank(sum(u * one for u, one in zip(units, roughness, strict=True)), hermitian=True))
    best = (np.inf, tuple(units))
    for ratio in ratios if len(roughness) > 1 else (1.0,):
        sizes = [unit * factor for unit, factor in zip(units, (ratio**-0.5, ratio**0.5), strict=False)]
        penalty = np.sum([size * one for size, one in zip(sizes, roughness, strict=True)], axis=0)
        bent = float(np.sum(np.log(np.linalg.eigvalsh(penalty)[len(gram) - rank :])))
        for decade in np.arange(ROUGHEST, SMOOTHEST, 1.0 / PER_DECADE):
            try:
                factor = cho_factor(gram + 10.0**decade * penalty, lower=True)
            except LinAlgError:  # so smooth that rounding hides what the data say
                break
            remaining = max(energy - float(along @ cho_solve(factor, along)), 1e-12 * energy)
            both = 2.0 * float(np.sum(np.log(np.diag(factor[0]))))
            criterion = (free - len(gram) + rank) * np.log(remaining) + both - bent - rank * decade * np.log(10.0)
            best = min(best, (float(criterion), tuple(float(size * 10.0**decade) for size in sizes)))
    return best[1]


def predicted_left(
    known: Floats, response: Floats, residual: Floats, penalty: Floats, folds: NDArray[np.int_]
) -> Floats:
    """Return what cross-validation leaves of the residual: every fold is predicted from the others.

    Parameters
    ----------
    known : (N, p) ndarray
        A.
    response : (N, m) ndarray
        R; m may be 0.
    residual : (N,) ndarray
        y, rad.
    penalty : (m, m) ndarray
        λ·P.
    folds : (N,) ndarray of int
        In which fold each row is left out; rows with a negative number are never left out.

    Returns
    -------
    (N,) ndarray
        rad.
    """
    columns = np.hstack([known, response])
    scale = np.linalg.norm(columns, axis=0)
    columns = columns / np.where(scale > 0.0, scale, 1.0)
    bent = np.zeros((len(scale), len(scale)))
    own = scale[known.shape[1] :]
    own = np.where(own > 0.0, own, 1.0)
    bent[known.shape[1] :, known.shape[1] :] = penalty / np.outer(own, own)
    bent += RIDGE * np.eye(len(scale))
    gram, along = columns.T @ columns, columns.T @ residual
    left = residual.copy()
    for fold in range(int(folds.max()) + 1):
        out = columns[folds == fold]
        solution = np.linalg.solve(gram - out.T @ out + bent, along - out.T @ residual[folds == fold])
        left[folds == fold] = residual[folds == fold] - out @ solution
    return left


def solved(gram: Floats, along: Floats) -> Floats:
    """Solve penalised normal equations, (m, m) and (m,); a direction that nothing determines stays near zero."""
    scale = np.sqrt(np.diag(gram))
    scale = np.where(scale > 0.0, scale, 1.0)
    return np.linalg.solve(gram / np.outer(scale, scale) + RIDGE * np.eye(len(gram)), along / scale) / scale
