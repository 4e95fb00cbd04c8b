"""A codec copies scenery at rest, so that it has no noise; the body, which moves, has some."""

import numpy as np

from anglecam.camera.lens import Lens
from anglecam.vision.registration.tile_choice import choose_tiles
from anglecam.vision.registration.tiles import TILE_SIDE_PX, FrameView, motion_plane

SIZE = (320, 240)
PIVOT = np.array([150.0, 120.0])
INNER, OUTER = 20.0, 90.0
"""Radii of the body, a ring with a smooth texture, px."""
NOISE = 3.0


def _film(frames):
    rng = np.random.default_rng(5)
    x, y = np.meshgrid(np.arange(SIZE[0]) - PIVOT[0], np.arange(SIZE[1]) - PIVOT[1])
    body = (np.hypot(x, y) > INNER) & (np.hypot(x, y) < OUTER)
    wall = 120.0 + 30.0 * np.sin(0.2 * x) * np.sin(0.17 * y)
    for turn in np.linspace(-0.3, 0.3, frames):
        u, v = np.cos(turn) * x - np.sin(turn) * y, np.sin(turn) * x + np.cos(turn) * y
        seen = 120.0 + 40.0 * np.sin(0.25 * u + 0.5) * np.cos(0.31 * v) + rng.normal(0.0, NOISE, x.shape)
        picture = np.where(body, seen, wall).round().clip(0, 255).astype(np.uint8)
        yield FrameView(picture[..., None], float(turn), PIVOT)


def test_tiles_of_a_body_with_noise_are_found_before_scenery_without():
    frames = list(_film(15))
    tiles = choose_tiles(frames, motion_plane(Lens(), SIZE), PIVOT, noise=0.29)
    assert len(tiles.corners) >= 20
    middle = np.hypot(*(tiles.corners + TILE_SIDE_PX / 2 - PIVOT).T)
    assert ((middle > INNER) & (middle < OUTER)).all()
