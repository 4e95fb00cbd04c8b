"""The rig as triangles: head, shaft end with its marker, crank, coupler, rocker, servo and base.

The shaft is the z axis and points at the camera; the face looks along +x. Each part belongs to one moving body, and
`poses` places the bodies for any head angle by the exact four-bar closure. Lengths in metres, colours 0-255.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import trimesh
from numpy.typing import NDArray
from trimesh.creation import box, cylinder

from anglecam.neck import FourBar, head_angle, joints
from synth.inflate import Body, inflate
from synth.profile import MM, head_profile
from synth.spec import NEUTRAL_SERVO, Rgb, Rig

Floats = NDArray[np.float64]

HALF_WIDTH = 64 * MM
"""Half the breadth of the head."""
FACE_Z = 92 * MM
"""How far the shaft's end stands towards the camera."""

_BUMPS_MM = [
    (110, 6, 12, 4.5, 0.10),  # upper lip
    (110, -7, 12, 4.5, 0.10),  # lower lip
    (114, -1, 10, 1.6, -0.10),  # the line between them
    (97, 66, 13, 8, -0.10),  # eye socket
    (97.2, 66.7, 5, 4, 0.05),  # eyeball
    (85, 30, 18, 16, 0.05),  # cheek
    (126, 27, 6, 5, 0.20),  # side of the nose
    (12, 50, 15, 22, 0.08),  # ear
    (14, 50, 6, 11, -0.10),  # and its hollow
]
_COLOURS: dict[str, Rgb] = {
    "hair": (58, 44, 38),
    "brow": (72, 54, 46),
    "eye": (236, 234, 228),
    "iris": (70, 96, 112),
    "pupil": (24, 22, 24),
    "nostril": (112, 78, 66),
}
_ALUMINIUM, _STEEL, _BRASS, _PLASTIC, _PAINT = (
    (172, 177, 182), (104, 110, 120), (178, 152, 92), (44, 46, 52), (84, 92, 104),
)  # fmt: skip
_PALE, _DARK = (238, 238, 234), (22, 22, 24)


@dataclass(frozen=True)
class Part:
    """One coloured piece that moves as a whole."""

    name: str
    body: str
    """``head``, ``crank``, ``coupler`` or ``ground``: a key of what `poses` returns."""
    mesh: trimesh.Trimesh
    """In the body's own frame, m."""
    colours: Floats
    """(n, 3), one for each vertex, sRGB 0-255."""


def build(rig: Rig, seed: int = 0) -> list[Part]:
    """Build every part of the rig.

    Parameters
    ----------
    rig : Rig
        Colours, marker and linkage.
    seed : int
        Of the skin's mottling.

    Returns
    -------
    list of Part
        In their bodies' frames.
    """
    return [*_head(rig, seed), *_shaft(rig), *_linkage(rig.linkage), *_stand(rig.linkage), _wall()]


def poses(linkage: FourBar, angle: float) -> dict[str, Floats]:
    """Place the moving bodies.

    Parameters
    ----------
    linkage : FourBar
        Link lengths, m.
    angle : float
        Head angle θ from neutral, rad, upward positive.

    Returns
    -------
    dict of str to ndarray
        Body to its (4, 4) pose.

    Raises
    ------
    ValueError
        If the links cannot close at this angle.
    """
    # θ_f is counted from the line B→A, so it shrinks as the head rises.
    joint = joints(linkage, neutral_rocker(linkage) - angle)
    A, C, D = joint["A"], joint["C"], joint["D"]
    return {
        "ground": np.eye(4),
        "head": _turn((0.0, 0.0), angle),
        "crank": _turn(A, math.atan2(*(C - A)[::-1])),
        "coupler": _turn(C, math.atan2(*(D - C)[::-1])),
    }


def neutral_rocker(linkage: FourBar) -> float:
    """θ_f with the head upright, rad: what a crank at 135° gives."""
    return float(head_angle(linkage, NEUTRAL_SERVO))


def mouth_centre(parts: list[Part], distance: float) -> Floats:
    """Centre of the lips' area as the camera sees them at neutral, as a point of the plane z = 0.

    Parameters
    ----------
    parts : list of Part
        With the lips.
    distance : float
        Of the camera from the plane z = 0, m.

    Returns
    -------
    ndarray
        (x, y), m.
    """
    lips = next(part.mesh for part in parts if part.name == "lips")
    flat = lips.vertices[:, :2] * (distance / (distance - lips.vertices[:, 2]))[:, None]
    corners = flat[lips.faces]
    ahead, behind = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = ahead[:, 0] * behind[:, 1] - ahead[:, 1] * behind[:, 0]
    seen = area > 0  # the far side is wound the other way round
    return np.asarray(np.average(corners[seen].mean(axis=1), axis=0, weights=area[seen]))


def _head(rig: Rig, seed: int) -> list[Part]:
    bumps = [(x * MM, y * MM, rx * MM, ry * MM, gain) for x, y, rx, ry, gain in _BUMPS_MM]
    body = inflate(head_profile(), HALF_WIDTH, 3 * MM, bumps)
    mottling = _mottling(body, np.random.default_rng(seed))
    ear = tuple(round(0.92 * level) for level in rig.skin_rgb)
    colours = {**_COLOURS, "lips": rig.lips_rgb, "skin": rig.skin_rgb, "ear": ear}
    parts = []
    for name in np.unique(body.labels):
        used, faces = np.unique(body.faces[body.labels == name], return_inverse=True)
        mesh = trimesh.Trimesh(
            body.vertices[used], faces.reshape(-1, 3), vertex_normals=body.normals[used], process=False
        )
        strength = {"skin": 1.0, "ear": 1.0, "hair": 0.8}.get(name, 0.0)
        colour = np.asarray(colours[name], dtype=float) * (1 + strength * mottling[used])[:, None]
        parts.append(Part(str(name), "head", mesh, np.clip(colour, 0, 255)))
    return parts


def _mottling(body: Body, rng: np.random.Generator) -> Floats:
    """Relative brightness of the skin: a few waves of 12 to 60 mm and a fine grain."""
    waves = 2 * np.pi / rng.uniform(12 * MM, 60 * MM, 24)
    heading, phase = rng.uniform(0, 2 * np.pi, (2, 24))
    x, y = body.vertices[:, 0, None], body.vertices[:, 1, None]
    slow = np.sin(waves * (x * np.cos(heading) + y * np.sin(heading)) + phase).sum(axis=1)
    return 0.008 * slow + 0.02 * rng.standard_normal(len(body.vertices))


def _shaft(rig: Rig) -> list[Part]:
    """Build the shaft through the head, its pale end face and the dark marker on it, all about the same axis."""
    parts = [
        _part("shaft", "head", _rod((0, 0), 9 * MM, -80 * MM, FACE_Z - 4 * MM), _ALUMINIUM),
        _part("shaft end", "head", _rod((0, 0), 15 * MM, FACE_Z - 4 * MM, FACE_Z), _PALE),
    ]
    if rig.marker != "none":
        hole = 4.5 * MM if rig.marker == "ring" else 0.0
        parts.append(_part("marker", "head", _annulus(hole, 8.5 * MM, FACE_Z + 0.3 * MM), _DARK))
    return parts


def _linkage(linkage: FourBar) -> list[Part]:
    rocker = _bar(linkage.rocker, 10 * MM, 80 * MM, 84 * MM)
    rocker.apply_transform(_turn((0.0, 0.0), math.pi - neutral_rocker(linkage)))
    return [
        _part("rocker", "head", rocker, _ALUMINIUM),
        _part("coupler", "coupler", _bar(linkage.coupler, 8 * MM, 85 * MM, 88 * MM), _BRASS),
        _part("crank", "crank", _bar(linkage.crank, 10 * MM, 80 * MM, 84 * MM), _PALE),
        _part("crank pin", "crank", _rod((linkage.crank, 0), 2.5 * MM, 80 * MM, 90 * MM), _STEEL),
        _part("rocker pin", "coupler", _rod((linkage.coupler, 0), 2.5 * MM, 80 * MM, 90 * MM), _STEEL),
        _part("horn", "crank", _rod((0, 0), 8 * MM, 72 * MM, 80 * MM), _PALE),
    ]


def _stand(linkage: FourBar) -> list[Part]:
    """Build what does not move: servo, its bracket, the upright that carries the shaft, the base."""
    A = -linkage.ground
    return [
        _part("servo", "ground", _block((A - 10 * MM, -30 * MM, 34 * MM), (A + 10 * MM, 10 * MM, 72 * MM)), _PLASTIC),
        _part("ears", "ground", _block((A - 10 * MM, -36 * MM, 60 * MM), (A + 10 * MM, 16 * MM, 63 * MM)), _PLASTIC),
        _part("bracket", "ground", _block((A - 14 * MM, -94 * MM, 40 * MM), (A + 14 * MM, -28 * MM, 58 * MM)), _PAINT),
        _part("upright", "ground", _block((-10 * MM, -94 * MM, 68 * MM), (10 * MM, 0, 78 * MM)), _STEEL),
        _part("bearing", "ground", _rod((0, 0), 19 * MM, 66 * MM, 79 * MM), _STEEL),
        _part("base", "ground", _block((-88 * MM, -130 * MM, -70 * MM), (44 * MM, -92 * MM, 80 * MM)), _PAINT),
    ]


def _wall() -> Part:
    """Build a plain wall, a little brighter above."""
    corners = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    mesh = trimesh.Trimesh(np.column_stack([corners, np.full(4, -0.2)]), [[0, 1, 2], [0, 2, 3]], process=False)
    grey = np.where(corners[:, 1:] > 0, [196.0, 204.0, 210.0], [120.0, 128.0, 136.0])
    return Part("wall", "ground", mesh, grey)


def _part(name: str, body: str, mesh: trimesh.Trimesh, rgb: Rgb) -> Part:
    mesh.unmerge_vertices()  # each triangle its own normals: edges of machined parts are sharp
    return Part(name, body, mesh, np.tile(np.asarray(rgb, dtype=float), (len(mesh.vertices), 1)))


def _rod(centre: tuple[float, float], radius: float, low: float, high: float) -> trimesh.Trimesh:
    rod = cylinder(radius=radius, height=high - low, sections=72)
    rod.apply_translation([*centre, (low + high) / 2])
    return rod


def _block(low: tuple[float, float, float], high: tuple[float, float, float]) -> trimesh.Trimesh:
    return box(bounds=[low, high])


def _bar(length: float, width: float, low: float, high: float) -> trimesh.Trimesh:
    """Build a link from the origin to (length, 0), round at both ends."""
    bar = trimesh.util.concatenate(
        [
            _block((0.0, -width / 2, low), (length, width / 2, high)),
            _rod((0.0, 0.0), width / 2, low, high),
            _rod((length, 0.0), width / 2, low, high),
        ]
    )
    assert isinstance(bar, trimesh.Trimesh)
    return bar


def _annulus(inner: float, outer: float, z: float) -> trimesh.Trimesh:
    """Build a flat ring, or a disc where `inner` is 0, facing the camera."""
    sections = 120
    turns = np.linspace(0, 2 * np.pi, sections, endpoint=False)
    around = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    vertices = np.column_stack([np.vstack([inner * around, outer * around]), np.full(2 * sections, z)])
    here = np.arange(sections)
    following = (here + 1) % sections
    faces = [
        np.column_stack([here, here + sections, following + sections]),
        np.column_stack([here, following + sections, following]),
    ]
    mesh = trimesh.Trimesh(vertices, np.vstack(faces), process=False)
    mesh.update_faces(mesh.nondegenerate_faces())  # a disc's inner circle is one point
    return mesh


def _turn(about: Floats | tuple[float, float], angle: float) -> Floats:
    """Pose of a body whose origin stands at `about`, turned by `angle`, rad."""
    pose = np.eye(4)
    pose[:2, :2] = [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
    pose[:2, 3] = about
    return pose
