"""Drawn clips of a chessboard in front of a camera with a known lens, independent of the code under test.

The grey level of a pixel is the mean over its area; where an edge of the board passes, it is the mean of 8 × 8 points.
The distortion is inverted by fixed-point iteration of its equation and not by OpenCV, so the test does not compare
OpenCV with itself.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import av
import cv2
import numpy as np
from scipy.spatial.transform import Rotation

_FINE = 8
"""Points along each side of a pixel that an edge crosses."""
_BLACK, _WHITE, _WALL = 30.0, 220.0, 120.0


@dataclass(frozen=True)
class BoardCamera:
    """A camera with square pixels and the distortion of Brown and Conrady."""

    size: tuple[int, int] = (640, 480)
    focal_px: float = 700.0
    centre_px: tuple[float, float] = (322.0, 237.0)
    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0

    @property
    def matrix(self) -> np.ndarray:
        """(3, 3)."""
        return np.array([[self.focal_px, 0, self.centre_px[0]], [0, self.focal_px, self.centre_px[1]], [0, 0, 1.0]])

    def bend(self, rays: np.ndarray) -> np.ndarray:
        """Return rays (…, 2) distorted, in units of the focal length."""
        x, y = rays[..., 0], rays[..., 1]
        r2 = x * x + y * y
        stretch = 1 + self.k1 * r2 + self.k2 * r2 * r2
        dx = 2 * self.p1 * x * y + self.p2 * (r2 + 2 * x * x)
        dy = self.p1 * (r2 + 2 * y * y) + 2 * self.p2 * x * y
        return np.stack([x * stretch + dx, y * stretch + dy], axis=-1)

    def project(self, rays: np.ndarray) -> np.ndarray:
        """Return the pixels (…, 2) of rays (…, 2)."""
        return self.bend(rays) * self.focal_px + self.centre_px

    def rays(self, pixels: np.ndarray) -> np.ndarray:
        """Return the rays (…, 2) of pixels (…, 2)."""
        seen = (np.asarray(pixels, float) - self.centre_px) / self.focal_px
        rays = seen.copy()
        for _ in range(60):
            step = seen - self.bend(rays)
            rays += step
            if np.abs(step).max() < 1e-11:
                break
        return rays


def poses(count: int, seed: int = 0, lean_deg: float = 35.0, board=(9, 6), square_m: float = 0.025, camera=None):
    """Return poses (rotation, position of the board's middle in m) that keep the whole board in the picture."""
    camera = camera or BoardCamera()
    rng = np.random.default_rng(seed)
    half = (np.array(board) + 1) * square_m / 2
    corners = np.array([[x, y, 0.0] for x in (-half[0], half[0]) for y in (-half[1], half[1])])
    low, high = camera.rays(np.array([[3.0, 3.0], [camera.size[0] - 4.0, camera.size[1] - 4.0]]))
    found = []
    while len(found) < count:
        lean, about = np.radians(rng.uniform(0, lean_deg)), rng.uniform(0, 2 * np.pi)
        turn = Rotation.from_rotvec(lean * np.array([np.cos(about), np.sin(about), 0])) * Rotation.from_euler(
            "z", rng.normal(0, 15), degrees=True
        )
        depth = rng.uniform(1.1, 2.0) * 2 * half[0] / (high - low)[0]
        for _ in range(30):
            place = np.array([*(rng.uniform(low, high) * depth), depth])
            seen = turn.apply(corners) + place
            rays = seen[:, :2] / seen[:, 2:]
            if (rays > low).all() and (rays < high).all():
                found.append((turn, place))
                break
    return found


def board_picture(camera: BoardCamera, pose, board=(9, 6), square_m: float = 0.025) -> np.ndarray:
    """Return (height, width) the mean grey of each pixel, for a board with a white rim of 0.7 squares."""
    turn, place = pose
    rays, across, down = _pixel_rays(camera)
    # a ray intersects the board's plane at M⁻¹·(x, y, 1) with M = [r1 r2 t]
    to_board = np.linalg.inv(np.column_stack([turn.as_matrix()[:, :2], place]))

    def on_board(rays: np.ndarray) -> np.ndarray:
        h = rays @ to_board[:, :2].T + to_board[:, 2]
        return h[..., :2] / h[..., 2:] / square_m + (np.array(board) + 1) / 2

    def grey(at: np.ndarray) -> np.ndarray:
        squares = np.array(board) + 1
        inside = ((at >= 0) & (at < squares)).all(axis=-1)
        paper = ((at >= -0.7) & (at < squares + 0.7)).all(axis=-1)
        dark = inside & (np.floor(at).sum(axis=-1) % 2 == 0)
        return np.where(dark, _BLACK, np.where(paper, _WHITE, _WALL))

    at = on_board(rays)
    picture = grey(at)
    # an edge can cross a pixel only where the grey level changes to the next pixel
    near = np.zeros(picture.shape, np.uint8)
    near[1:] |= picture[1:] != picture[:-1]
    near[:, 1:] |= picture[:, 1:] != picture[:, :-1]
    rows, columns = np.nonzero(cv2.dilate(near, np.ones((3, 3), np.uint8)))
    offsets = (np.arange(_FINE) + 0.5) / _FINE - 0.5
    dx, dy = (o.reshape(1, -1, 1) for o in np.meshgrid(offsets, offsets))
    fine = rays[rows, columns][:, None] + across[rows, columns][:, None] * dx + down[rows, columns][:, None] * dy
    picture[rows, columns] = grey(on_board(fine)).mean(axis=1)
    return picture


@functools.cache
def _pixel_rays(camera: BoardCamera) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the rays (height, width, 2) of all pixels, and their change from column to column and from row to row."""
    width, height = camera.size
    rays = camera.rays(np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).astype(float))
    return rays, np.gradient(rays, axis=1), np.gradient(rays, axis=0)


def film_board(
    path: Path,
    camera: BoardCamera,
    views,
    *,
    board=(9, 6),
    square_m: float = 0.025,
    noise_grey: float = 2.0,
    hold: int = 3,
    seed: int = 1,
) -> None:
    """Write a lossless clip: each pose lasts `hold` frames, the first of them blurred as if the board still moved."""
    pictures: list[np.ndarray] = []
    for pose in views:
        sharp = board_picture(camera, pose, board, square_m)
        pictures += [cv2.blur(sharp, (9, 1))] + [sharp] * (hold - 1)
    write_pictures(path, pictures, noise_grey, seed)


def write_pictures(path: Path, pictures: Sequence[np.ndarray], noise_grey: float = 2.0, seed: int = 1) -> None:
    """Write grey pictures (height, width) as an FFV1 clip at 30 Hz, each with independent noise."""
    rng = np.random.default_rng(seed)
    with av.open(str(path), "w") as container:
        stream = container.add_stream("ffv1", rate=30)
        stream.height, stream.width = pictures[0].shape
        stream.pix_fmt = "bgr0"
        for picture in pictures:
            noise = noise_grey * rng.standard_normal((*picture.shape, 3), dtype=np.float32)
            frame = av.VideoFrame.from_ndarray(
                np.clip(np.rint(picture[..., None] + noise), 0, 255).astype(np.uint8), format="bgr24"
            )
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
