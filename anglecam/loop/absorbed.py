"""The part of a residual, or of a change of the predictions, that the parameters of a fit can follow."""

from __future__ import annotations

import numpy as np

from anglecam.data.typing import Floats
from anglecam.identification.fit import Fit


def absorbed_space(fit: Fit) -> Floats:
    """Return an orthonormal basis, (N, k), of the column space of the fit's Jacobian."""
    used = np.linalg.norm(fit.jacobian, axis=0) > 0.0  # the column of a parameter at its bound may be zero
    basis, _ = np.linalg.qr(fit.jacobian[:, used])
    return basis
