"""What is filmed: each scene's body, surroundings, light and motion.

The camera looks along −z from a realistic distance, with the axis of rotation parallel to the optical axis and away
from the principal point. Lengths are centimetres. The plane of motion, in which the mark lies, is z = 0.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import surfaces

Shape = dict[str, Any]
RATE_HZ = 30.0


@dataclass(frozen=True)
class Camera:
    """A pinhole camera."""

    size: tuple[int, int] = (640, 480)
    distance: float = 75.0
    """From the plane of motion, cm."""
    px_per_cm: float = 17.0
    """Scale in the plane of motion."""

    @property
    def focal_px(self) -> float:
        """Focal length, px."""
        return self.px_per_cm * self.distance

    def project(self, place: Sequence[float]) -> np.ndarray:
        """Return the image (2,) of a place (3,) in cm, in px; the middle of the upper left pixel is (0, 0)."""
        x, y, z = place
        middle = (np.array(self.size) - 1.0) / 2.0
        return middle + self.focal_px / (self.distance - z) * np.array([x, -y])

    def place(self, pixel: Sequence[float], z: float = 0.0) -> np.ndarray:
        """Return the place (3,) in cm at depth ``z`` that is seen at a pixel (2,)."""
        x, y = (np.array(pixel) - (np.array(self.size) - 1.0) / 2.0) * (self.distance - z) / self.focal_px
        return np.array([x, -y, z])


@dataclass(frozen=True)
class Scene:
    """A film before it is rendered."""

    name: str
    frames: int
    angle_deg: Callable[[np.ndarray], np.ndarray]
    """Of the time (n,) in s; counter-clockwise as seen."""
    pivot_px: tuple[float, float]
    """Where the axis meets the plane of motion."""
    mark_cm: tuple[float, float, float]
    """The mark on the body at angle 0, from the axis."""
    body: Callable[[Path], list[Shape]]
    """Shapes that turn, from the axis at angle 0; called with a folder for meshes."""
    still: Callable[[np.ndarray, Path], list[Shape]]
    """Shapes that do not; called with the axis (3,)."""
    lights: tuple[Shape, ...]
    region_px: tuple[int, int, int, int]
    """Left, top, right, bottom of a rectangle that the body fills in the first frame: a careful user's choice."""
    samples: int = 16
    camera: Camera = Camera()


def swing(amplitude_deg: float, hertz: float, decay_s: float) -> Callable[[np.ndarray], np.ndarray]:
    """Return a released swing that decays."""
    return lambda t: amplitude_deg * np.cos(2 * np.pi * hertz * t) * np.exp(-t / decay_s)


def steps(
    *levels: tuple[float, float], hertz: float = 1.3, damping: float = 0.13
) -> Callable[[np.ndarray], np.ndarray]:
    """Return the underdamped response to steps, given as (time in s, level in °); it starts at rest at zero."""

    def response(t: np.ndarray) -> np.ndarray:
        w = 2 * np.pi * hertz
        late, fast = np.maximum(t, 0.0), w * np.sqrt(1 - damping**2)
        ringing = np.cos(fast * late) + damping * w / fast * np.sin(fast * late)
        return 1.0 - np.exp(-damping * w * late) * ringing

    heights = np.diff([0.0] + [level for _, level in levels])
    return lambda t: sum(h * response(t - at) for h, (at, _) in zip(heights, levels, strict=True))


def _diffuse(rgb: Sequence[float]) -> Shape:
    return {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(rgb)}}


def _painted(colour: np.ndarray, kind: str = "diffuse", **more: Any) -> Shape:
    """Return a material with a reflectance map (rows, columns, 3)."""
    slot = "reflectance" if kind == "diffuse" else "diffuse_reflectance"
    return {"type": kind, slot: {"type": "bitmap", "data": colour.astype(np.float32), "raw": True}, **more}


def _at(shape: str, place: Sequence[float], scale: Sequence[float], bsdf: Shape, turn_deg: float = 0.0) -> Shape:
    return {"type": shape, "place": tuple(place), "scale": tuple(scale), "turn_deg": turn_deg, "bsdf": bsdf}


def _lamp(place: Sequence[float], target: Sequence[float], side: float, radiance: float) -> Shape:
    return {"type": "lamp", "place": list(place), "target": list(target), "side": side, "radiance": radiance}


def _fill(radiance: float) -> Shape:
    return {"type": "constant", "radiance": {"type": "rgb", "value": [radiance] * 3}}


def _wall(z: float, base: tuple[float, float, float], strength: float, seed: int) -> Shape:
    return _at("rectangle", (0, 0, z), (48, 36, 1), _painted(surfaces.mottled(768, 1024, base, strength, seed)))


def _head(complexion: surfaces.Complexion, gloss: bool) -> Callable[[Path], list[Shape]]:
    middle = (1.2, 7.2, 0.0)

    def body(folder: Path) -> list[Shape]:
        coarse, fine = surfaces.sphere_directions(250, 500), surfaces.sphere_directions(1024, 2048)
        surfaces.write_star(folder / "head.ply", surfaces.head_radius(coarse), coarse)
        ball = surfaces.sphere_directions(100, 200)
        surfaces.write_star(folder / "ball.ply", np.ones(ball.shape[:2]), ball)
        colour = surfaces.head_colour(fine, complexion)
        skin = _painted(colour, "roughplastic", alpha=0.35, nonlinear=False) if gloss else _painted(colour)
        neck = _painted(surfaces.mottled(256, 512, complexion.skin, 0.06, 11))
        return [
            {**_at("ply", middle, (1, 1, 1), skin), "filename": "head.ply"},
            {**_at("ply", (0.2, 6.6, 6.3), (1.5, 2.2, 0.8), _diffuse(complexion.skin), 12.0), "filename": "ball.ply"},
            {**_at("ply", (-0.6, 1.2, 0.0), (4.2, 5.0, 4.0), neck), "filename": "ball.ply"},
            _at("cylinder", (0, 0, -9.0), (1.5, 1.5, 13.8), _diffuse((0.55, 0.55, 0.56))),
            _at("disk", (0, 0, 4.8), (1.5, 1.5, 1), _diffuse((0.72, 0.72, 0.70))),
            _at("disk", (0, 0, 4.81), (0.75, 0.75, 1), _diffuse((0.04, 0.04, 0.05))),
        ]

    return body


def _head_mouth() -> tuple[float, float, float]:
    x, y, _ = np.array(surfaces.MOUTH) / np.linalg.norm(surfaces.MOUTH) * 8.0
    return (float(x) + 1.2, float(y) + 7.2, 0.0)


def _stand(wall: Shape) -> Callable[[np.ndarray, Path], list[Shape]]:
    def still(axis: np.ndarray, _: Path) -> list[Shape]:
        x, y, _z = axis
        base = _diffuse((0.13, 0.14, 0.16))
        return [
            wall,
            _at("cube", (x - 0.5, y - 7.0, -3.0), (3.4, 4.5, 3.0), base),
            _at("cube", (x - 1.0, y - 12.5, -2.0), (11.0, 2.2, 5.0), _diffuse((0.32, 0.24, 0.16))),
        ]

    return still


_NODS = steps((0.3, 13.0), (1.4, -9.0), (2.4, 4.0))
_ABOVE = (_lamp((-8, 62, 38), (0, 0, 0), 9.0, 70.0), _fill(0.16))
_SIDE = (_lamp((58, 14, 36), (0, 0, 0), 9.0, 62.0), _fill(0.14))
_FACE = (180, 70, 340, 240)
_HEAD_ABOVE = Scene(
    "head_above", 100, _NODS, (236.0, 318.0), _head_mouth(), _head(surfaces.Complexion(), gloss=False),
    _stand(_wall(-22.0, (0.34, 0.40, 0.36), 0.18, 21)), _ABOVE, _FACE,
)  # fmt: skip
_HEAD_SIDE = replace(
    _HEAD_ABOVE,
    name="head_side",
    angle_deg=lambda t: _NODS(t) + 6.0 * np.sin(2 * np.pi * 0.31 * t),
    pivot_px=(241.3, 322.6),
    body=_head(surfaces.Complexion((0.42, 0.25, 0.17), (0.30, 0.21, 0.12), (0.46, 0.04, 0.05)), gloss=True),
    still=_stand(_wall(-16.0, (0.46, 0.42, 0.38), 0.25, 22)),
    lights=_SIDE,
)


def _ball(
    colour: Callable[[], Shape], radius: float, length: float
) -> tuple[Callable[[Path], list[Shape]], tuple[float, float, float]]:
    """Return a ball on a rod that hangs from the axis, and the ball's middle."""

    def body(folder: Path) -> list[Shape]:
        ball = surfaces.sphere_directions(200, 400)
        surfaces.write_star(folder / "ball.ply", np.ones(ball.shape[:2]), ball)
        rod = {**_at("rod", (0, 0, 0), (0.12, 0.12, length), _diffuse((0.25, 0.25, 0.26)))}
        return [{**_at("ply", (0, -length, 0), (radius,) * 3, colour()), "filename": "ball.ply"}, rod]

    return body, (0.0, -length, 0.0)


def _hung(wall: Shape) -> Callable[[np.ndarray, Path], list[Shape]]:
    def still(axis: np.ndarray, _: Path) -> list[Shape]:
        return [wall, _at("cube", (axis[0], axis[1] + 1.2, -1.0), (5.0, 0.8, 2.0), _diffuse((0.30, 0.22, 0.14)))]

    return still


def _pattern() -> Shape:
    return _painted(surfaces.patterned(surfaces.sphere_directions(512, 1024), (0.7, 0.62, 0.2), (0.1, 0.16, 0.4)))


def _ball_scene(
    name: str, colour: Callable[[], Shape], radius: float, pivot_px: tuple[float, float], seed: int
) -> Scene:
    body, mark = _ball(colour, radius, 15.0)
    camera = Camera(distance=110.0)
    x, y = pivot_px[0], pivot_px[1] + 15.0 * camera.px_per_cm
    half = 0.6 * radius * camera.px_per_cm
    shift = 15.0 * camera.px_per_cm * np.sin(np.radians(19.0))
    region = tuple(int(v) for v in (x + shift - half, y - half - 14, x + shift + half, y + half - 14))
    wall = _wall(-14.0, (0.36, 0.37, 0.40), 0.22, seed)
    return Scene(name, 90, swing(19.0, 0.9, 2.5), pivot_px, mark, body, _hung(wall), _ABOVE, region, 25, camera)


def _stick(_: Path) -> list[Shape]:
    return [_at("cube", (0.0, 6.5, 0.0), (0.55, 7.5, 0.4), _diffuse((0.33, 0.33, 0.34)))]


def _ruler(_: Path) -> list[Shape]:
    """Return a wooden ruler on a screw, with a red dot at its lower end."""
    return [
        _at("cube", (0.0, -7.5, 0.0), (0.75, 9.2, 0.2), _diffuse((0.62, 0.47, 0.28))),
        _at("disk", (0.0, -15.0, 0.21), (0.62, 0.62, 1), _diffuse((0.62, 0.03, 0.04))),
        _at("disk", (0.0, 0.0, 0.21), (0.45, 0.45, 1), _diffuse((0.04, 0.04, 0.05))),
    ]


def _on_ring(radius: float, around: float, scale: Sequence[float], rgb: Sequence[float]) -> Shape:
    """Return a block at an angle ``around`` (rad, clockwise from the top), turned to face the hub."""
    place = (radius * np.sin(around), radius * np.cos(around), 0.0)
    return _at("cube", place, scale, _diffuse(rgb), -float(np.degrees(around)))


def _wheel(_: Path) -> list[Shape]:
    spokes = [_on_ring(4.0, a, (0.28, 3.9, 0.2), (0.5, 0.5, 0.52)) for a in 2 * np.pi * np.arange(5) / 5]
    rim = [_on_ring(8.0, a, (0.75, 0.45, 0.6), (0.06, 0.06, 0.07)) for a in 2 * np.pi * np.arange(36) / 36]
    valve = _on_ring(7.0, 0.3, (0.18, 0.6, 0.2), (0.6, 0.55, 0.3))
    hub = _at("cylinder", (0, 0, -1.5), (1.3, 1.3, 2.2), _diffuse((0.28, 0.28, 0.30)))
    return [*spokes, *rim, valve, hub, _at("disk", (0, 0, 0.7), (1.3, 1.3, 1), _diffuse((0.28, 0.28, 0.30)))]


def _only(wall: Shape) -> Callable[[np.ndarray, Path], list[Shape]]:
    return lambda axis, folder: [wall]


SCENES: dict[str, Scene] = {
    scene.name: scene
    for scene in (
        _HEAD_ABOVE,
        _HEAD_SIDE,
        replace(_HEAD_ABOVE, name="head_short", frames=30, angle_deg=swing(15.0, 1.4, 1.2), pivot_px=(239.4, 320.2)),
        _ball_scene("ball_dark", lambda: _diffuse((0.05, 0.05, 0.06)), 1.8, (327.6, 92.3), 31),
        Scene(
            "stick", 90, steps((0.2, 22.0), (1.2, -18.0), (2.2, 8.0)), (312.4, 371.7), (0.0, 13.5, 0.0), _stick,
            _only(_wall(-10.0, (0.5, 0.47, 0.42), 0.2, 41)), _ABOVE, (306, 150, 318, 360), 25, Camera(distance=110.0),
        ),
        Scene(
            "wheel", 100, lambda t: 150.0 * t + 20.0 * np.sin(2 * np.pi * 0.7 * t), (334.2, 251.8), (0.0, 8.0, 0.0),
            _wheel, _only(_wall(-12.0, (0.42, 0.45, 0.48), 0.2, 42)), _ABOVE, (236, 154, 432, 350), 25,
            Camera(distance=110.0),
        ),
        Scene(
            "ruler", 60, swing(24.0, 0.95, 2.2), (239.6, 62.3), (0.0, -15.0, 0.21), _ruler,
            _hung(_wall(-12.0, (0.40, 0.45, 0.50), 0.18, 43)), _ABOVE, (310, 200, 340, 250), 36,
            Camera((480, 360), 110.0, 15.5),
        ),
        _ball_scene("ball_white", lambda: _diffuse((0.8, 0.8, 0.78)), 1.5, (301.2, -31.4), 32),
        _ball_scene("ball_grey", lambda: _diffuse((0.22, 0.22, 0.22)), 1.8, (342.9, 88.6), 33),
        _ball_scene("ball_green", lambda: _diffuse((0.08, 0.4, 0.12)), 0.6, (318.7, 101.1), 34),
        _ball_scene("ball_pattern", _pattern, 2.2, (309.5, 80.4), 35),
    )
}  # fmt: skip
