"""The paper's servo controller, Table 2: it rounds the commanded position and repeats it in pulses.

A position is an unsigned number over 180° of the servo's arm, 8 bits in the paper (Fig. 13), which the straight line
of Eq. (3) turns into head angle: 180°/255 · 0.357 = 0.25° of the head a level. Neutral is a level. A new position is
taken over when the next pulse begins, 50 times a second in the paper.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from anglecam.neck import FourBar
from synth.motion.linkage import straight_gamma
from synth.spec import Controller

Floats = NDArray[np.float64]

PUNCTUAL_PULSES = 1e-6
"""A command this share of a period late still makes it into the pulse: rows are rounded to a microsecond."""


def level_size(bits: int, linkage: FourBar) -> float:
    """Head angle from one level to the next, rad."""
    return math.pi / (2**bits - 1) * abs(straight_gamma(linkage))


def send(times: Floats, angles: Floats, controller: Controller, linkage: FourBar) -> tuple[Floats, Floats]:
    """Turn what is commanded into what the servo is told.

    Parameters
    ----------
    times : ndarray
        Of the commands, s, ascending.
    angles : ndarray
        Commanded head angles, rad, each held until the next.
    controller : Controller
        Bits and pulses, each of which may be absent.
    linkage : FourBar
        Link lengths, m.

    Returns
    -------
    times, angles : ndarray
        When which head angle is told; a command that another one overtakes before the next pulse is lost.
    """
    if controller.bits is not None:
        size = level_size(controller.bits, linkage)
        furthest = (2**controller.bits - 1) // 2
        angles = np.clip(np.round(angles / size), -furthest, furthest) * size
    if controller.pulse_hz is not None:
        pulses = np.ceil((times - controller.phase_s) * controller.pulse_hz - PUNCTUAL_PULSES)
        last = np.append(np.diff(pulses) > 0, True)
        times, angles = controller.phase_s + pulses[last] / controller.pulse_hz, angles[last]
    return times, angles
