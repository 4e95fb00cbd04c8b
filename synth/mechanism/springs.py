"""Two pre-tensioned springs pull the back of the head down and hold the face up, Fig. 6 of the paper.

They are on either side of the head's plane of symmetry, between a hook at distance L2 behind the shaft and the rod at
distance L6 on the rocker. Hook, shaft and rod form the triangle of Eq. (17), so a spring's length is
sqrt(L2² + L6² − 2·L2·L6·cos θ_f).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anglecam.neck import FourBar
from synth.mechanism.curves import MM
from synth.mechanism.linkage import neutral_rocker
from synth.mechanism.part import Part, machined
from synth.mechanism.solids import joined, placed, shift, tube
from synth.spec import NeckPlant, Spec

Floats = NDArray[np.float64]

SPRINGS = ("spring near", "spring far")
"""Names of the springs' bodies."""
_Z = {"spring near": 68 * MM, "spring far": -68 * MM}
_COIL, _WIRE, _TURNS = 4.4 * MM, 0.8 * MM, 8
"""Radius of the coil, radius of the wire, m, and the number of turns."""
_LEG = 0.12
"""Length of each straight end as a share of the spring's length."""
_COLOUR = (206, 210, 214)


@dataclass(frozen=True)
class Suspension:
    """Attachment of the springs; the defaults are the paper's."""

    anchor: float = 0.048
    """Distance from the shaft back to the hook, L2, m."""
    arm: float = 0.059
    """Distance from the shaft to the rod on the rocker, L6, m."""


PAPER = Suspension()


def suspension(spec: Spec) -> Suspension:
    """Return the attachment of the springs from a plant that has springs, otherwise the paper's."""
    if isinstance(spec.plant, NeckPlant):
        return Suspension(spec.plant.spring_base, spec.plant.spring_arm)
    return PAPER


def springs(linkage: FourBar, hung: Suspension) -> list[Part]:
    """Build both springs with their length at neutral, from the origin along +x of their frames."""
    hook, rod = ends(linkage, hung, 0.0)
    length = float(np.hypot(*(rod - hook)))
    turns = np.linspace(0, 2 * np.pi * _TURNS, 13 * _TURNS + 1)
    along = np.linspace(_LEG, 1 - _LEG, len(turns))
    coil = np.stack([along * length, _COIL * np.sin(turns), _COIL * np.cos(turns)], axis=1)
    # a leg runs from the axis out to the coil and back to the axis
    axis = np.array([[0.0], [_LEG / 2], [1 - _LEG / 2], [1.0]]) * [length, 0.0, 0.0]
    first, last = np.vstack([axis[:2], coil[:1]]), np.vstack([coil[-1:], axis[2:]])
    wire = joined([tube(path, _WIRE, 6) for path in (first, coil, last)])
    return [machined(body, body, placed(wire, shift(0, 0, z)), _COLOUR) for body, z in _Z.items()]


def spring_poses(linkage: FourBar, hung: Suspension, angle: float) -> dict[str, Floats]:
    """Return the poses (4, 4) of both springs at a head angle, rad: from hook to rod, stretched along the coil."""
    neutral = float(np.hypot(*np.diff(ends(linkage, hung, 0.0), axis=0)[0]))
    hook, rod = ends(linkage, hung, angle)
    along = (rod - hook) / neutral
    across = np.array([-along[1], along[0]]) / np.hypot(*along)
    pose = np.eye(4)
    pose[:2, 0], pose[:2, 1], pose[:2, 3] = along, across, hook
    return dict.fromkeys(SPRINGS, pose)


def ends(linkage: FourBar, hung: Suspension, angle: float) -> Floats:
    """Return the positions of hook and rod, (2, 2), m, at a head angle, rad."""
    rocker = neutral_rocker(linkage) - angle
    return np.array([[-hung.anchor, 0.0], [-hung.arm * math.cos(rocker), hung.arm * math.sin(rocker)]])
