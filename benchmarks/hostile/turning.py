"""Films in which a pendulum, a head-like plate or a wheel turns by a known angle, each with one hostile trait."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np

from benchmarks.hostile.draw import (
    BLUE,
    DARK,
    GREEN,
    RED,
    SIZE,
    Film,
    ball,
    moved,
    paint,
    room,
    stick,
    texture,
)

N = 120
T = np.arange(N) / 30.0
MARGIN = 50
"""Scenery around the picture that a moving camera sees, px."""
PIVOT, LEVER = np.array([200.0, 60.0]), 160.0


def _swing(times: np.ndarray = T, amplitude_deg: float = 20.0) -> np.ndarray:
    return amplitude_deg * np.exp(-0.08 * times) * np.cos(2 * np.pi * 0.75 * times + 0.4)


def _pendulum(
    picture: np.ndarray, angle_deg: float, colour: Any, *, pivot: Any = PIVOT, lever: float = LEVER, disc: bool = True
) -> None:
    bob = np.asarray(pivot) + lever * np.array([np.sin(np.radians(angle_deg)), np.cos(np.radians(angle_deg))])
    stick(picture, pivot, bob, 2.5, (80, 80, 85))
    if disc:
        ball(picture, pivot, 8, DARK)
    ball(picture, bob, 13, colour)


_SURFACE = texture((141, 181), 50, 3.0, 40.0)


def _plate(picture: np.ndarray, angle_deg: float, colour: Any, *, pivot: Any = PIVOT) -> None:
    """Turn a textured plate with a mark about a pivot near its upper edge."""
    surface = _SURFACE.copy()
    ball(surface, (70, 150), 12, colour)
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    turn = np.array([[c, s], [-s, c]])
    matrix = np.column_stack([turn, np.asarray(pivot) - turn @ (70.0, 10.0)])
    layer = cv2.warpAffine(surface, matrix, picture.shape[1::-1], flags=cv2.INTER_CUBIC)
    x, y = np.meshgrid(np.arange(picture.shape[1], dtype=float), np.arange(picture.shape[0], dtype=float))
    px, py = x - pivot[0], y - pivot[1]
    u, v = c * px - s * py, s * px + c * py
    paint(picture, np.maximum(np.abs(u) - 68.0, np.abs(v - 80.0) - 88.0), layer)
    ball(picture, pivot, 7, (30, 30, 30))


def _filmed(draw: Any, angles: np.ndarray, colour: Any, seed: int, **more: Any) -> Iterator[np.ndarray]:
    background = room(seed=seed)
    for angle in angles:
        picture = background.copy()
        draw(picture, angle, colour, **more)
        yield picture


def _from_moving_camera(
    draw: Any, angles: np.ndarray, colour: Any, seed: int, shifts: np.ndarray, zooms: np.ndarray, rolls: np.ndarray
) -> Iterator[np.ndarray]:
    wide = room((SIZE[0] + 2 * MARGIN, SIZE[1] + 2 * MARGIN), seed=seed)
    for angle, shift, zoom, roll in zip(angles, shifts, zooms, rolls, strict=True):
        picture = wide.copy()
        draw(picture, angle, colour, pivot=PIVOT + MARGIN)
        yield moved(picture, shift, zoom, roll)


def _repeated(angles: np.ndarray, rows: tuple[int, ...]) -> np.ndarray:
    shown = angles.copy()
    for i in rows:
        shown[i] = shown[i - 1]
    return shown


def _wander(rms: float, seed: int) -> np.ndarray:
    walk = cv2.GaussianBlur(np.random.default_rng(seed).standard_normal((N, 2)), (0, 0), sigmaX=0.01, sigmaY=8.0)
    return walk * rms / walk.std()


def _wandering_pivot(angles: np.ndarray, colour: Any, seed: int) -> Iterator[np.ndarray]:
    background = room(seed=seed)
    for angle, off in zip(angles, _wander(12.0, seed), strict=True):
        picture = background.copy()
        _pendulum(picture, angle, colour, pivot=PIVOT + off, disc=False)
        yield picture


def _behind_a_post(angles: np.ndarray, colour: Any, seed: int) -> Iterator[np.ndarray]:
    for i, picture in enumerate(_filmed(_pendulum, angles, colour, seed)):
        if 40 <= i < 75:
            stick(picture, (212, 150), (212, 300), 14, (120, 110, 90))
        yield picture


def _beside_another(angles: np.ndarray, colour: Any, seed: int) -> Iterator[np.ndarray]:
    other = 14 * np.cos(2 * np.pi * 1.1 * T)
    for picture, angle in zip(_filmed(_pendulum, angles, colour, seed), other, strict=True):
        _pendulum(picture, angle, colour, pivot=(345, 40), lever=90.0)
        yield picture


def _wheel(angles: np.ndarray, colour: Any, seed: int) -> Iterator[np.ndarray]:
    background = room(seed=seed)
    for angle in angles:
        picture = background.copy()
        ball(picture, (200, 150), 110, (205, 200, 190))
        ball(picture, (200, 150), 100, (150, 150, 155))
        for k in range(5):
            turn = np.radians(angle + 72.0 * k)
            stick(picture, (200, 150), (200 + 98 * np.cos(turn), 150 - 98 * np.sin(turn)), 4, (90, 85, 80))
        ball(picture, (200, 150), 9, DARK)
        turn = np.radians(angle + 36.0)
        ball(picture, (200 + 80 * np.cos(turn), 150 - 80 * np.sin(turn)), 12, colour)
        yield picture


def _flickering(angles: np.ndarray, colour: Any, seed: int) -> Iterator[np.ndarray]:
    for i, picture in enumerate(_filmed(_pendulum, angles, colour, seed)):
        yield picture * (1.0 + 0.15 * np.sin(2.3 * i))


def films() -> Iterator[Film]:
    """Yield the films, each drawn as it is read, in red and in another colour."""
    swing = _swing()
    none, one = np.zeros((N, 2)), np.ones(N)
    rows = tuple(range(11, N - 2, 8))
    pan = np.column_stack([40 * (0.5 - 0.5 * np.cos(2 * np.pi * T / 3.7)), 8 * np.sin(T)])
    shake = _wander(2.0, 5)
    uneven = np.cumsum(np.random.default_rng(6).uniform(0.02, 0.05, N))
    for k, (colour, name) in enumerate(((RED, "red"), (BLUE, "blue"))):
        seed = 60 + 40 * k
        repeated = _repeated(swing, rows)

        def camera(
            shifts: np.ndarray = none,
            zooms: np.ndarray = one,
            rolls: np.ndarray = 0.0 * one,
            draw: Any = _pendulum,
            seed: int = seed,
            colour: Any = colour,
        ) -> Iterator[np.ndarray]:
            return _from_moving_camera(draw, swing, colour, seed, shifts, zooms, rolls)

        yield Film(f"plain-{name}", _filmed(_pendulum, swing, colour, seed), swing)
        yield Film(f"plate-{name}", _filmed(_plate, swing, colour, seed), swing)
        repeats = {"repeats": rows}
        yield Film(
            f"repeats-exact-{name}", _filmed(_pendulum, repeated, colour, seed), swing, same_noise=True, **repeats
        )
        yield Film(f"repeats-fresh-noise-{name}", _filmed(_pendulum, repeated, colour, seed), swing, **repeats)
        yield Film(
            f"repeats-h264-{name}",
            _filmed(_pendulum, repeated, colour, seed),
            swing,
            codec="h264",
            options={"crf": "20"},
            same_noise=True,
            **repeats,
        )
        yield Film(
            f"repeats-plate-fresh-noise-{name}", _filmed(_plate, repeated, colour, seed), swing, noise=1.0, **repeats
        )
        yield Film(f"shakes-{name}", camera(shake), swing)
        yield Film(f"pans-{name}", camera(pan), swing)
        yield Film(f"zooms-{name}", camera(zooms=1.0 + 0.12 * np.sin(2 * np.pi * T / 3.1)), swing)
        yield Film(f"zooms-slightly-{name}", camera(zooms=1.0 + 0.01 * np.sin(2 * np.pi * T / 3.1)), swing)
        yield Film(f"zooms-slightly-plate-{name}", camera(zooms=np.linspace(1.0, 1.03, N), draw=_plate), swing)
        yield Film(f"rolls-{name}", camera(rolls=1.5 * np.sin(2 * np.pi * T / 2.3)), swing)
        yield Film(f"rolls-plate-{name}", camera(rolls=1.5 * np.sin(2 * np.pi * T / 2.3), draw=_plate), swing)
        yield Film(f"pivot-wanders-{name}", _wandering_pivot(swing, colour, seed), swing)
        small = _swing(amplitude_deg=1.5)
        yield Film(f"small-swing-{name}", _filmed(_pendulum, small, colour, seed, disc=False), small)
        yield Film(f"small-swing-marked-{name}", _filmed(_pendulum, small, colour, seed), small)
        crf = {"codec": "h264", "options": {"crf": "51"}}
        yield Film(f"crf51-{name}", _filmed(_pendulum, swing, colour, seed), swing, **crf)
        yield Film(f"occluded-{name}", _behind_a_post(swing, colour, seed), swing)
        yield Film(f"second-pendulum-{name}", _beside_another(swing, colour, seed), swing)
        turns = 200.0 * T + 20.0 * np.sin(3 * T)
        yield Film(f"wheel-{name}", _wheel(turns, colour, seed), turns)
        yield Film(f"flickers-{name}", _flickering(swing, colour, seed), swing)
        late = _swing(uneven)
        yield Film(f"variable-rate-{name}", _filmed(_pendulum, late, colour, seed), late, uneven, codec="h264")
    yield Film("dot-green", _filmed(_pendulum, swing, GREEN, 70, lever=190.0), swing, noise=4.0)
    yield Film("crf51-plate", _filmed(_plate, swing, RED, 71), swing, codec="h264", options={"crf": "51"})
