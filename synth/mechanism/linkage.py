"""The four-bar before the head: shaft end with its marker, rocker, coupler, crank on the servo's horn.

Each link lies in a layer of its own above the plane of motion, so that none runs into another at any angle.
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
"""How far the shaft's end stands towards the camera."""
MARKER, HOLE, END = 8.5 * MM, 4.5 * MM, 15 * MM
"""Radii of the dark marker, of the hole in a ring, and of the pale end of the shaft, m."""
_ARMS = (80 * MM, 84 * MM)
_COUPLER = (85 * MM, 88 * MM)


def shaft(rig: Rig, offset: tuple[float, float] | None) -> list[Part]:
    """Build the shaft through the head, its pale end and the dark marker on it, all about the same axis.

    Parameters
    ----------
    rig : Rig
        Of which the marker counts.
    offset : tuple of float or None
        Where not ``None``, pale end and marker are no longer the shaft's but a cover of the bearing, which stands
        still and is off the axis by this much, m.

    Returns
    -------
    list of Part
        In their bodies' frames.
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
        From the shaft to where the springs pull at the rocker, m.

    Returns
    -------
    list of Part
        Rocker and coupler along +x of their bodies' frames, the rocker in its place on the head.
    """
    at_neutral = turn((0.0, 0.0), math.pi - neutral_rocker(linkage))
    reach = max(linkage.rocker, arm)
    rocker = joined([link(reach, (12 * MM, 9 * MM), *_ARMS), rod((0, 0), 11 * MM, 79.5 * MM, 84.6 * MM)])
    # the springs pull at a rod across the head, which a second arm on the far side carries too
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
    """θ_f with the head upright, rad: what a crank at 135° gives."""
    return float(head_angle(linkage, NEUTRAL_SERVO))


def link_poses(linkage: FourBar, angle: float) -> dict[str, Floats]:
    """Place crank and coupler for a head angle, rad, by exact closure; ``ValueError`` where the links cannot close."""
    # θ_f is counted from the line B→A, so it shrinks as the head rises.
    joint = joints(linkage, neutral_rocker(linkage) - angle)
    A, C, D = joint["A"], joint["C"], joint["D"]
    return {
        "crank": turn(A, math.atan2(*(C - A)[::-1])),
        "coupler": turn(C, math.atan2(*(D - C)[::-1])),
    }


def _pin(at: float) -> trimesh.Trimesh:
    return joined([rod((at, 0), 2.2 * MM, 81 * MM, 89 * MM, 24), rod((at, 0), 3.2 * MM, 88.3 * MM, 90.5 * MM, 24)])
