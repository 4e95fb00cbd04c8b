"""Other objects in the picture: a sync lamp, bars that pass in front of the mouth, a mug of the lips' colour.

They are fixed to the camera at the spec's pixels, square to the line of sight and nearer than the rig, so that neither
the view nor the head ever hides them. Objects that are not visible at a time are placed behind the wall.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import trimesh
from numpy.typing import NDArray

from synth.camera import Pinhole
from synth.mechanism.backdrop import BEHIND
from synth.mechanism.curves import MM
from synth.mechanism.head import lips_outline
from synth.mechanism.part import Part, machined
from synth.mechanism.sight import facing, ideal, metres
from synth.mechanism.solids import block, joined, placed, sheet, tube, turned
from synth.spec import Rgb, Spec
from synth.spec.picture import Distractor, Occluder

Floats = NDArray[np.float64]

NEARER, NEAREST = 170 * MM, 190 * MM
"""Heights above the plane of motion, towards the camera, of lamp and mug, and of the bars, m."""
LENS_PX, HOUSING_PX = 7.0, 10.0
"""Radii of the lamp's lens and housing, px."""
SWAY_HZ = 0.5
_HOUSING, _GLASS, _LIT, _SHELF = (40, 40, 44), (74, 62, 54), (255, 247, 222), (92, 80, 70)


def props(spec: Spec, camera: Pinhole) -> list[Part]:
    """Build the scene's objects besides the rig.

    Parameters
    ----------
    spec : Spec
        Its scene and the lips' colour are used.
    camera : Pinhole
        At rest.

    Returns
    -------
    list of Part
        Lamp housing and shelf belong to body ``ground``, the others to the bodies of `prop_poses`.
    """
    scene = spec.scene
    parts = []
    if scene.lamp_px is not None:
        parts += _lamp(camera, scene.lamp_px)
    for number, occluder in enumerate(scene.occluders):
        name = f"occluder-{number}"
        parts.append(machined(name, name, _bar(occluder, camera), occluder.rgb))
    if scene.distractor is not None:
        parts += _mug(scene.distractor, camera, scene.distractor.rgb or spec.rig.lips_rgb)
    return parts


def prop_poses(spec: Spec, camera: Pinhole, time: float, lamp_on: bool) -> dict[str, Floats]:
    """Return the poses of the scene's moving objects.

    Parameters
    ----------
    spec : Spec
        Its scene is used, and the head whose mouth the bars cover.
    camera : Pinhole
        At rest: the scene does not move with a vibrating camera.
    time : float
        Time since the recording began, s.
    lamp_on : bool
        Whether the lamp is lit.

    Returns
    -------
    dict of str to ndarray
        (4, 4) poses of ``lamp``, ``mug`` and ``occluder-0``, …, as far as the scene has them.
    """
    scene = spec.scene
    placed_at = {}
    if scene.lamp_px is not None:
        placed_at["lamp"] = facing(camera, ideal(camera, scene.lamp_px), NEARER) if lamp_on else _hidden(camera)
    if (mug := scene.distractor) is not None:
        sway = mug.sway_px * math.sin(2 * math.pi * SWAY_HZ * time)
        x, y = mug.at_px
        placed_at["mug"] = facing(camera, ideal(camera, (x + sway, y)), NEARER)
    if scene.occluders:
        mouth = dataclasses.replace(camera, k1=0.0).draw(lips_outline(spec.rig))[0]
        for number, occluder in enumerate(scene.occluders):
            placed_at[f"occluder-{number}"] = _passing(occluder, camera, mouth, time)
    return placed_at


def _passing(occluder: Occluder, camera: Pinhole, mouth: Floats, time: float) -> Floats:
    """Return a bar's pose: at `from_s` its leading edge reaches the mouth, `for_s` later its trailing edge leaves."""
    low, high = mouth[:, 0].min(), mouth[:, 0].max()
    width = occluder.width_px
    gone = (width + high - low) / occluder.for_s * (time - occluder.from_s)
    x = high + width / 2 - gone if camera.mirrored else low - width / 2 + gone
    # lens distortion can move points just outside the picture into it
    outside = abs(x - (camera.size[0] - 1) / 2) > 0.75 * camera.size[0] + width / 2
    if outside:
        return _hidden(camera)
    return facing(camera, np.array([x, mouth[:, 1].mean()]), NEAREST)


def _hidden(camera: Pinhole) -> Floats:
    return facing(camera, np.asarray(camera.principal_px), -2 * BEHIND)


def _lamp(camera: Pinhole, pixel: tuple[float, float]) -> list[Part]:
    px = metres(camera, NEARER)
    at = facing(camera, ideal(camera, pixel), NEARER)
    rim, lens = HOUSING_PX * px, LENS_PX * px
    housing = turned([(0, -rim), (rim, -rim), (rim, 0), (rim - px, px), (lens, px), (lens, -px)])
    glass = turned([(lens, -0.5 * px), (0, 0)])
    lit = turned([(lens, 0.2 * px), (0.6 * lens, 0.9 * px), (0, 1.2 * px)])
    return [
        machined("lamp housing", "ground", placed(housing, at), _HOUSING),
        machined("lamp glass", "ground", placed(glass, at), _GLASS),
        machined("lamp", "lamp", lit, _LIT),
    ]


def _bar(occluder: Occluder, camera: Pinhole) -> trimesh.Trimesh:
    px = metres(camera, NEAREST)
    width, height = occluder.width_px * px, 3.0 * camera.size[1] * px  # from beyond the upper edge to beyond the lower
    return sheet(np.array([-width / 2, -height / 2, 0]), np.array([width, 0, 0]), np.array([0, height, 0]))


def _mug(mug: Distractor, camera: Pinhole, rgb: Rgb) -> list[Part]:
    px = metres(camera, NEARER)
    radius = mug.width_px / 2 * px
    tall = 1.1 * radius  # half its height
    upright = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
    inner = 0.9 * radius
    cup = placed(
        turned([(0, -tall), (radius, -tall), (radius, tall), (inner, tall), (inner, -0.8 * tall), (0, -0.8 * tall)]),
        upright,
    )
    bend = np.linspace(np.pi / 2, -np.pi / 2, 25)
    handle = tube(
        np.stack([0.93 * radius + 0.55 * radius * np.cos(bend), 0.55 * tall * np.sin(bend), 0 * bend], axis=1),
        0.11 * radius,
        12,
    )
    half = 1.3 * radius + mug.sway_px * px
    shelf = block((-half, -tall - 5 * px, -radius), (half + 0.4 * radius, -tall - 0.1 * px, radius))
    at = facing(camera, ideal(camera, mug.at_px), NEARER)
    return [
        machined("mug", "mug", joined([cup, handle]), rgb),
        machined("shelf", "ground", placed(shelf, at), _SHELF),
    ]
