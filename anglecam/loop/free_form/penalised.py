"""Penalised least squares of the residual on the responses to a curve: how smooth the curve is, and how well it predicts.

    minimise |y − A·β − R·α|² + λ·αᵀPα

y is the whitened residual, A the derivatives with respect to the plant's parameters, R the responses to each parameter
of the curve and P the curve's roughness, a sum of squared second differences (Eilers and Marx, Statist. Sci. 11, 1996).
λ maximises the restricted likelihood, in which α is a random effect (Patterson and Thompson, Biometrika 58, 1971;
Wood, J. R. Statist. Soc. B 73, 2011).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from anglecam.data.typing import Floats

SMOOTHEST, ROUGHEST, PER_DECADE = 6.0, -7.0, 4
"""Decades between which λ is searched, relative to the λ at which penalty and data count alike."""
RIDGE = 1e-9
"""Share of the mean curvature of the cost that is added to every parameter, for splines where no data are."""


def smoothing(response: Floats, left: Floats, penalty: Floats, free: int) -> float:
    """Return the λ that maximises the restricted likelihood.

    Parameters
    ----------
    response : (N, m) ndarray
        R without the part that A can follow, rad per parameter.
    left : (N,) ndarray
        y without the part that A can follow, rad.
    penalty : (m, m) ndarray
        P.
    free : int
        N less the rank of A.

    Returns
    -------
    float
        λ.
    """
    gram, along, energy = response.T @ response, response.T @ left, float(left @ left)
    unit = float(np.trace(gram) / np.trace(penalty))
    ridge = RIDGE * np.trace(gram) / len(gram) * np.eye(len(gram))
    rank = int(np.linalg.matrix_rank(penalty, hermitian=True))
    unbent = len(gram) - rank
    best = (np.inf, unit)
    for decade in np.arange(ROUGHEST, SMOOTHEST, 1.0 / PER_DECADE):
        size = unit * 10.0**decade
        factor = cho_factor(gram + ridge + size * penalty, lower=True)
        remaining = max(energy - float(along @ cho_solve(factor, along)), 1e-12 * energy)
        half_logdet = float(np.sum(np.log(np.diag(factor[0]))))
        criterion = (free - unbent) * np.log(remaining) + 2.0 * half_logdet - rank * np.log(size)
        best = min(best, (float(criterion), float(size)))
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
