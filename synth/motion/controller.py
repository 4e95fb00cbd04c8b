"""The paper's servo controller, Table 2: it quantises the commanded position and sends it in pulses.

A position is an unsigned integer over 180° of the servo's arm, 8 bits in the paper (Fig. 13). The straight line of
Eq. (3) converts it to head angle: 180°/255 · 0.357 = 0.25° of the head per level. Neutral is one of the levels. A new
position takes effect when the next pulse begins, 50 times a second in the paper.
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
"""A command late by this share of a period still counts for the pulse, because rows are rounded to a microsecond."""


def level_size(bits: int, linkage: FourBar) -> float:
    """Return the head angle between adjacent levels, rad."""
    return math.pi / (2**bits - 1) * abs(straight_gamma(linkage))


def send(times: Floats, angles: Floats, controller: Controller, linkage: FourBar) -> tuple[Floats, Floats]:
    """Quantise commands and delay them to the controller's pulses.

    Parameters
    ----------
    times : ndarray
        Times of the commands, s, ascending.
    angles : ndarray
        Commanded head angles, rad, each held until the next.
    controller : Controller
        Bits and pulses, either of which may be absent.
    linkage : FourBar
        Link lengths, m.

    Returns
    -------
    times, angles : ndarray
        The head angles that the servo receives and their times; a command replaced before the next pulse is lost.
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
