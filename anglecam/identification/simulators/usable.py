"""Whether another program may use a model: it does not run away, its servo is not reversed, and it is determined."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from anglecam.errors import InputError
from anglecam.identification.export import SECOND_ORDER, FittedModel

SIGMAS = 2.0
"""Standard uncertainties by which a value has to differ from zero for its sign to be known (95 %, normal)."""


def require_usable(model: FittedModel, path: Path) -> None:
    """Raise `InputError` where a simulation of a model would not be one of the mechanism that was recorded.

    Parameters
    ----------
    model : FittedModel
        From `anglecam.identification.simulators.mechanism.linear_model`.
    path : Path
        Its file, for the message.

    Raises
    ------
    InputError
        Naming the file and the cause: an unstable model, a servo that moves against its command, or a gain that the
        recordings do not determine.
    """
    value = dict(zip(model.names, model.values.tolist(), strict=True))
    sigma = dict(zip(model.names, model.sigmas.tolist(), strict=True))
    a, b, c = SECOND_ORDER
    if value.get(a, 0.0) < 0.0:
        raise InputError(
            f"{path}: {_stated(a, value, sigma)}: with negative damping a simulated body gains energy; record longer,"
            " or close the loop, which names what drives the body"
        )
    # a drive without stiffness has a b of zero, and its estimate may be a little below
    if b in value and value[b] < -SIGMAS * np.nan_to_num(sigma[b]):
        raise InputError(
            f"{path}: {_stated(b, value, sigma)}: with negative stiffness a simulated body falls away from neutral;"
            " a mass above its axis needs a servo that holds it"
        )
    if a not in value and np.any(model.poles.real > 0.0):
        raise InputError(f"{path}: the model is unstable: a pole at {model.poles.real.max():.3g} 1/s")
    if c not in value:
        return
    if not abs(value[c]) > SIGMAS * sigma[c]:
        raise InputError(
            f"{path}: {_stated(c, value, sigma)}: the recordings do not determine the servo's gain; record commands"
            " that move the body farther"
        )
    if value[c] < 0.0:
        raise InputError(
            f"{path}: {_stated(c, value, sigma)}: the body moves against its command; change the sign of the command"
            " or of the angle and identify again"
        )


def _stated(name: str, value: dict[str, float], sigma: dict[str, float]) -> str:
    known = np.isfinite(sigma[name])
    return f"{name} = {value[name]:.4g}" + (f" ± {sigma[name]:.2g}" if known else ", not determined")
