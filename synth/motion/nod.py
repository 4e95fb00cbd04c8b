"""A human nod: a minimum-jerk motion from rest to rest.

After a share τ of the time a minimum-jerk motion has covered 10τ³ − 15τ⁴ + 6τ⁵ of its distance (Flash and Hogan,
J. Neurosci. 5(7), 1985, Eq. (3)). The paper's subject took 0.3 s for 70° without overshoot, Fig. 10 (b).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from synth.spec import Nod

Floats = NDArray[np.float64]


def nod(command: Nod, times: Floats) -> Floats:
    """Return the motion of a nod: rest, rise, hold, and back.

    Parameters
    ----------
    command : Nod
        Angles and times of the nod.
    times : ndarray, shape (n,)
        s.

    Returns
    -------
    ndarray, shape (2, n)
        θ, rad, and θ̇, rad/s.
    """
    rise = math.radians(command.rise_deg)
    up = (times - command.rest_s) / command.rise_s
    down = up - 1 - command.hold_s / command.rise_s
    angle = math.radians(command.from_deg) + rise * (_distance(up) - _distance(down))
    return np.stack([angle, rise / command.rise_s * (_speed(up) - _speed(down))])


def _distance(share: Floats) -> Floats:
    tau = np.clip(share, 0.0, 1.0)
    return tau**3 * (10 - 15 * tau + 6 * tau**2)


def _speed(share: Floats) -> Floats:
    tau = np.clip(share, 0.0, 1.0)
    return 30 * tau**2 * (1 - tau) ** 2
