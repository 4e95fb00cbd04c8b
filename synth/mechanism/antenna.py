"""An antenna on the head, which shows the motion of the effect `elastic_coupling`."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from synth.mechanism.curves import MM
from synth.mechanism.part import ALUMINIUM, DARK, Part, machined
from synth.mechanism.solids import joined, placed, rod, turn, turned

Floats = NDArray[np.float64]

HINGE = (-46 * MM, 150 * MM)
"""Position of the hinge on the back of the crown, m."""
_LEAN = math.radians(32)
"""Angle of the antenna at rest, backwards from upright, rad."""
_LENGTH, _RADIUS, _TIP = 48 * MM, 1.4 * MM, 4 * MM


def antenna() -> list[Part]:
    """Build the antenna about its hinge, upright along +y of its frame, and its socket on the head."""
    lying = np.eye(4)[[0, 2, 1, 3]] * [[1], [1], [-1], [1]]  # from the lathe's axis z to y
    angles = np.linspace(-np.pi / 2, np.pi / 2, 13)
    ball = [(_TIP * math.cos(t), _LENGTH + _TIP * math.sin(t)) for t in angles]
    stem = turned([(0, 0), (_RADIUS, 0), (_RADIUS, _LENGTH)], 16)
    return [
        machined("antenna", "appendage", placed(stem, lying), ALUMINIUM),
        machined("antenna tip", "appendage", placed(turned(ball, 24), lying), (196, 148, 40)),
        machined("antenna socket", "head", joined([rod(HINGE, 6 * MM, -6 * MM, 6 * MM)]), DARK),
    ]


def antenna_pose(angle: float) -> Floats:
    """Return the pose (4, 4) of the antenna in the head's frame, turned by `angle`, rad, from rest."""
    return turn(HINGE, _LEAN + angle)
