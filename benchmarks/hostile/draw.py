"""Pictures from NumPy alone: coverage of balls, sticks and textured plates, a background, sensor noise, a codec.

Coverage of a pixel is clip(½ − signed distance), which locates an edge to a few thousandths of a pixel. Nothing is
shared with `synth`, with the films of `tests/support`, or with the code that measures.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np

RED, BLUE, GREEN = (190, 30, 35), (40, 70, 190), (40, 140, 60)
DARK, WHITE, ORANGE = (35, 35, 40), (240, 240, 235), (220, 130, 30)
SIZE = (400, 300)
"""Width and height, px."""
RATE = 30


@dataclass(frozen=True)
class Film:
    """One film with its truth."""

    name: str
    frames: Iterable[np.ndarray]
    """(h, w, 3) red, green, blue, float."""
    angle_deg: np.ndarray | None = None
    """(n,) counter-clockwise as seen; ``None`` where nothing turns about a fixed pivot."""
    times_s: np.ndarray | None = None
    """(n,) time stamps; ``None``: `RATE`."""
    noise: float = 2.0
    codec: str = "ffv1"
    options: dict[str, str] = field(default_factory=dict)
    repeats: tuple[int, ...] = ()
    """Frames that show the one before again."""
    same_noise: bool = False
    """Whether a repeated frame has the noise of the one before too."""


def grid(size: tuple[int, int] = SIZE) -> tuple[np.ndarray, np.ndarray]:
    x, y = np.meshgrid(np.arange(size[0], dtype=float), np.arange(size[1], dtype=float))
    return x, y


def paint(picture: np.ndarray, distance: np.ndarray, colour: Any) -> None:
    """Cover what has a negative signed distance, px, with a colour or an (h, w, 3) texture."""
    cover = np.clip(0.5 - distance, 0.0, 1.0)[..., None]
    picture += cover * (np.asarray(colour, float) - picture)


def ball(picture: np.ndarray, at: Any, radius: float, colour: Any = RED) -> None:
    x, y = grid(picture.shape[1::-1])
    paint(picture, np.hypot(x - at[0], y - at[1]) - radius, colour)


def stick(picture: np.ndarray, start: Any, end: Any, radius: float, colour: Any = DARK) -> None:
    x, y = grid(picture.shape[1::-1])
    along = np.subtract(end, start)
    px, py = x - start[0], y - start[1]
    share = np.clip((px * along[0] + py * along[1]) / max(float(along @ along), 1e-9), 0.0, 1.0)
    paint(picture, np.hypot(px - share * along[0], py - share * along[1]) - radius, colour)


def box(picture: np.ndarray, at: Any, half: Any, colour: Any = RED, turn_deg: float = 0.0) -> None:
    """Paint a rectangle with its middle at ``at``, turned counter-clockwise as seen."""
    x, y = grid(picture.shape[1::-1])
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    px, py = x - at[0], y - at[1]
    u, v = np.abs(c * px - s * py) - half[0], np.abs(s * px + c * py) - half[1]
    paint(picture, np.maximum(u, v), colour)


def texture(size: tuple[int, int], seed: int, scale: float = 4.0, contrast: float = 30.0) -> np.ndarray:
    """Return a smooth random picture (h, w, 3) around middle grey."""
    rng = np.random.default_rng(seed)
    rough = rng.standard_normal((size[1], size[0], 1)) + 0.3 * rng.standard_normal((size[1], size[0], 3))
    smooth = cv2.GaussianBlur(rough, (0, 0), scale)
    return 140.0 + contrast * smooth / smooth.std()


def room(size: tuple[int, int] = SIZE, seed: int = 0) -> np.ndarray:
    """Return a wall with a table, frames and books: straight edges and some texture."""
    rng = np.random.default_rng(seed)
    picture = np.empty((size[1], size[0], 3))
    picture[:] = (176, 170, 160)
    picture += 0.15 * (texture(size, seed, 8.0) - 140.0)
    for _ in range(14):
        at = rng.uniform((0, 0), size)
        box(picture, at, rng.uniform(8, 40, 2), rng.uniform(70, 210) + rng.uniform(-25, 25, 3), rng.uniform(-8, 8))
    return picture


def plain(size: tuple[int, int] = SIZE) -> np.ndarray:
    picture = np.empty((size[1], size[0], 3))
    picture[:] = (182, 178, 170)
    return picture


def moved(
    picture: np.ndarray, shift: Any = (0.0, 0.0), zoom: float = 1.0, roll_deg: float = 0.0, size: Any = SIZE
) -> np.ndarray:
    """Return the part of a larger picture that a moved camera sees; the middles coincide at rest."""
    centre = (np.array(picture.shape[1::-1]) - 1.0) / 2.0
    seen = (np.array(size) - 1.0) / 2.0
    c, s = np.cos(np.radians(roll_deg)) / zoom, np.sin(np.radians(roll_deg)) / zoom
    turn = np.array([[c, -s], [s, c]])
    matrix = np.column_stack([turn, centre + shift - turn @ seen])
    flags = cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
    return cv2.warpAffine(picture, matrix, size, flags=flags, borderMode=cv2.BORDER_REFLECT)


def write(film: Film, folder: Path, seed: int = 0) -> Path:
    """Add optics' blur and the sensor's noise, and write the film."""
    path = folder / f"{film.name}.{'avi' if film.codec == 'ffv1' else 'mp4'}"
    rng = np.random.default_rng(seed)
    with av.open(path, "w") as container:
        stream = None
        shown = np.zeros(0)
        for i, frame in enumerate(film.frames):
            if i not in film.repeats or not film.same_noise:
                soft = cv2.GaussianBlur(frame, (0, 0), 0.7)
                shown = np.clip(np.round(soft + film.noise * rng.standard_normal(soft.shape)), 0, 255).astype(np.uint8)
            if stream is None:
                stream = container.add_stream(film.codec, rate=RATE, options=film.options)
                stream.height, stream.width = shown.shape[:2]
                stream.pix_fmt = "bgr0" if film.codec == "ffv1" else "yuv420p"
                stream.codec_context.time_base = Fraction(1, 3000)
                stream.time_base = Fraction(1, 3000)
            picture = av.VideoFrame.from_ndarray(shown, format="rgb24")
            picture.pts = round(3000 * (i / RATE if film.times_s is None else film.times_s[i]))
            picture.time_base = Fraction(1, 3000)
            container.mux(stream.encode(picture))
        assert stream is not None
        container.mux(stream.encode())
    return path
