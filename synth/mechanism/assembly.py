"""The assembled rig: all its parts, and the pose of each body at any angle of the head.

The shaft is the z axis and points at the camera; the face looks along +x. Lengths in metres, colours 0-255.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from synth.effects.elastic_coupling import ElasticCoupling
from synth.effects.pivot_offset import PivotOffset
from synth.mechanism.antenna import antenna, antenna_pose
from synth.mechanism.backdrop import backdrop
from synth.mechanism.head import head, mouth_centre
from synth.mechanism.linkage import link_poses, links, shaft
from synth.mechanism.part import Part
from synth.mechanism.person import person
from synth.mechanism.solids import turn
from synth.mechanism.springs import PAPER, Suspension, spring_poses, springs, suspension
from synth.mechanism.stand import stand
from synth.spec import Rig, Spec

Floats = NDArray[np.float64]

TEXTURE = (2**32 - 1,)
"""Spawn key of the skin's texture under the spec's seed; too large to collide with a recording's number."""


def build(spec: Spec, offset: tuple[float, float] = (0.0, 0.0)) -> list[Part]:
    """Build the rig and the wall behind it.

    Parameters
    ----------
    spec : Spec
        Its rig states what to build, its plant where the springs are attached, its effects whether there is an
        antenna and whether the marker is on the bearing, its camera the size of the wall, its seed the skin's texture.
    offset : tuple of float
        Distance of the marker from the axis if the spec has a ``pivot_offset``, m.

    Returns
    -------
    list of Part
        Meshes in their bodies' frames.
    """
    rig = spec.rig
    rng = np.random.default_rng(np.random.SeedSequence(spec.seed, spawn_key=TEXTURE))
    parts = head(rig, rng)
    lever = float(np.hypot(*mouth_centre(parts, spec.camera.distance_m)))
    parts.append(backdrop(spec, lever))
    if rig.neck == "human":
        return [*parts, *person(rig, rng)]
    hung = suspension(spec)
    parts += shaft(rig, offset if spec.effects.get(PivotOffset) else None)
    parts += [*links(rig.linkage, hung.arm), *springs(rig.linkage, hung), *stand(rig.linkage, hung.anchor)]
    if spec.effects.get(ElasticCoupling):
        parts += antenna()
    return parts


def poses(rig: Rig, angle: float, appendage: float = 0.0, hung: Suspension = PAPER) -> dict[str, Floats]:
    """Return the poses of the moving bodies.

    Parameters
    ----------
    rig : Rig
        Its neck and its linkage are used.
    angle : float
        Head angle θ from neutral, rad, upward positive.
    appendage : float
        Angle of the antenna from its rest on the head, rad.
    hung : Suspension
        Attachment of the springs, from `suspension`.

    Returns
    -------
    dict of str to ndarray
        Body to its (4, 4) pose; a spring's pose includes its stretch along the coil.

    Raises
    ------
    ValueError
        If the links cannot close at this angle.
    """
    placed = {"ground": np.eye(4), "head": turn((0.0, 0.0), angle)}
    if rig.neck == "human":
        return placed
    return {
        **placed,
        **link_poses(rig.linkage, angle),
        **spring_poses(rig.linkage, hung, angle),
        "appendage": placed["head"] @ antenna_pose(appendage),
    }
