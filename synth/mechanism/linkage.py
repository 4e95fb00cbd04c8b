"""The four-bar in front of the head: shaft end with its marker, rocker, coupler, crank on the servo's horn.

Each link lies in a separate layer above the plane of motion, so that links do not collide at any angle.
"""

from __future__ import annotations

import math

import numpy as np
import trimesh
from numpy.typing import NDArray

from anglecam.neck import FourBar, head_angle, joints
from synth.mechanism.curves import MM
from synth.mechanism.part import ALUMINIUM, BRASS, DARK, PALE, STEEL, Part, machined
from synth.mechanism.solids import annulus, joined, link, placed, rod, shift, turn, turned
from synth.spec import NEUTRAL_SERVO, Rig

Floats = NDArray[np.float64]

FACE_Z = 92 * MM
"""Height of the shaft's end above the plane of motion, towards the camera, m."""
MARKER, HOLE, END = 8.5 * MM, 4.5 * MM, 15 * MM
"""Radii of the dark marker, of the hole in a ring, and of the pale end of the shaft, m."""
_ARMS = (80 * MM, 84 * MM)
_COUPLER = (85 * MM, 88 * MM)


def shaft(rig: Rig, offset: tuple[float, float] | None) -> list[Part]:
    """Build the shaft through the head, its pale end and the dark marker on it, all on the same axis.

    Parameters
    ----------
    rig : Rig
        Its marker is used.
    offset : tuple of float or None
        Unless ``None``, pale end and marker are part of a cover of the bearing instead of the shaft. The cover does not
        turn, and it is off the axis by this much, m.

    Returns
    -------
    list of Part
        Meshes in their bodies' frames.
    """
    body, at = ("head", shift(0, 0)) if offset is None else ("ground", shift(*offset))
    edge = 0.6 * MM
    end = turned([(0, 85 * MM), (END, 85 * MM), (END, FACE_Z - edge), (END - edge, FACE_Z), (0, FACE_Z)], 144)
    parts = [
        machined("shaft", "head", rod((0, 0), 9 * MM, 55 * MM, 86 * MM), ALUMINIUM),
        machined("shaft end", body, placed(end, at), PALE),
    ]
    if rig.marker != "none":
        face = annulus(HOLE if rig.marker == "ring" else 0.0, MARKER, FACE_Z + 0.3 * MM)
        parts.append(machined("marker", body, placed(face, at), DARK))
    return parts


def links(linkage: FourBar, arm: float) -> list[Part]:
    """Build rocker, coupler and crank with their pins.

    Parameters
    ----------
    linkage : FourBar
        Link lengths, m.
    arm : float
        Distance from the shaft to the springs' attachment on the rocker, m.

    Returns
    -------
    list of Part
        Rocker and coupler along +x of their bodies' frames, the rocker in its position on the head.
    """
    at_neutral = turn((0.0, 0.0), math.pi - neutral_rocker(linkage))
    reach = max(linkage.rocker, arm)
    rocker = joined([link(reach, (12 * MM, 9 * MM), *_ARMS), rod((0, 0), 11 * MM, 79.5 * MM, 84.6 * MM)])
    # the springs pull at a rod across the head, which has a second arm on the far side
    cross = joined([rod((arm, 0), 2 * MM, -84 * MM, 82 * MM, 16), link(arm, (12 * MM, 9 * MM), -84 * MM, -80 * MM)])
    holes = [rod((share * linkage.crank, 0), 1.1 * MM, 83 * MM, 84.25 * MM, 16) for share in (0.38, 0.56, 0.74)]
    return [
        machined("rocker", "head", placed(rocker, at_neutral), ALUMINIUM),
        machined("spring rod", "head", placed(cross, at_neutral), STEEL),
        machined("coupler", "coupler", link(linkage.coupler, (8 * MM, 8 * MM), *_COUPLER), BRASS),
        machined("rocker pin", "coupler", _pin(linkage.coupler), STEEL),
        machined("crank", "crank", link(linkage.crank, (10 * MM, 8 * MM), *_ARMS), PALE),
        machined("crank pin", "crank", _pin(linkage.crank), STEEL),
        machined("horn", "crank", rod((0, 0), 7.5 * MM, 75 * MM, 84.5 * MM), PALE),
        machined("horn screw", "crank", rod((0, 0), 2.6 * MM, 76 * MM, 85.6 * MM, 24), STEEL),
        machined("holes", "crank", joined(holes), DARK),
    ]


def neutral_rocker(linkage: FourBar) -> float:
    """Return θ_f with the head upright, rad: the rocker's angle at a crank angle of 135°."""
    return float(head_angle(linkage, NEUTRAL_SERVO))


def link_poses(linkage: FourBar, angle: float) -> dict[str, Floats]:
    """Return the poses of crank and coupler at a head angle, rad; ``ValueError`` if the links cannot close."""
    # θ_f is measured from the line B→A, so it decreases as the head rises.
    joint = joints(linkage, neutral_rocker(linkage) - angle)
    A, C, D = joint["A"], joint["C"], joint["D"]
    return {
        "crank": turn(A, math.atan2(*(C - A)[::-1])),
        "coupler": turn(C, math.atan2(*(D - C)[::-1])),
    }


def _pin(at: float) -> trimesh.Trimesh:
    return joined([rod((at, 0), 2.2 * MM, 81 * MM, 89 * MM, 24), rod((at, 0), 3.2 * MM, 88.3 * MM, 90.5 * MM, 24)])
