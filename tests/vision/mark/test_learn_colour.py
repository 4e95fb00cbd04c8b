"""The colour learnt from painted squares is the one they were painted in, separated as Fisher's discriminant says."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from anglecam.vision.mark.blob_tracks import BlobTrack
from anglecam.vision.mark.blobs import find_blobs
from anglecam.vision.mark.colour import fit_discriminant
from anglecam.vision.mark.cues import RED
from anglecam.vision.mark.learn_colour import learn_colour

WALL, MARK = np.array([120.0, 130.0, 140.0]), np.array([40.0, 35.0, 190.0])


def _pixels(rng: np.random.Generator, mean: np.ndarray, count: int) -> np.ndarray:
    return np.clip(np.round(rng.normal(mean, 6.0, (count, 3))), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("count", [20, 333, 40_000])
def test_the_discriminant_is_fishers(count):
    rng = np.random.default_rng(count)
    inside, around, elsewhere = (_pixels(rng, c, n) for c, n in ((MARK, count), (WALL, 2 * count), (WALL + 20, count)))
    model = fit_discriminant(inside, around, elsewhere)
    beside = around.mean(axis=0)
    np.testing.assert_array_equal(model.mean_bgr, inside.mean(axis=0))
    off = elsewhere - beside
    within = np.cov(inside.T) + 0.7 * np.cov(around.T) + 0.3 * off.T @ off / count + 9.0 * np.eye(3)
    direction = np.linalg.solve(within, model.mean_bgr - beside)
    np.testing.assert_allclose(model.weights / np.linalg.norm(model.weights), direction / np.linalg.norm(direction))
    assert model.weights @ beside + model.offset == pytest.approx(0.0, abs=1e-12)
    assert model.weights @ model.mean_bgr + model.offset == pytest.approx(1.0, abs=1e-12)
    value = around @ model.weights + model.offset
    assert model.noise == pytest.approx(1.4826 * np.median(np.abs(value - np.median(value))), rel=1e-9)


def _track_of_a_square(colour: np.ndarray) -> tuple[list[np.ndarray], list[np.ndarray], BlobTrack]:
    rng = np.random.default_rng(3)
    images = []
    for left in (20, 50, 80):
        image = np.tile(WALL, (90, 130, 1))
        image[30:50, left : left + 20] = colour
        images.append(np.clip(np.round(image + rng.normal(0.0, 2.0, image.shape)), 0, 255).astype(np.uint8))
    labs = [cv2.cvtColor(image, cv2.COLOR_BGR2LAB) for image in images]
    maps = [cv2.GaussianBlur(RED.contrast(lab), (0, 0), 1.0) for lab in labs]
    level = float(np.median(maps[0]) + maps[0].max()) / 2.0
    (blobs,) = find_blobs(maps, [level], float(np.median(maps[0])), lambda _, point: point)
    return images, maps, BlobTrack(1.0, level, np.flatnonzero(blobs.area > 300), blobs, None)


def test_the_colour_of_a_square_is_learnt_from_its_pixels():
    images, maps, track = _track_of_a_square(MARK)
    model = learn_colour(images, maps, track, 0.15)
    assert len(track.members) == 3
    assert model is not None
    assert model.mean_bgr == pytest.approx(MARK, abs=0.3)
    assert model.weights @ WALL + model.offset == pytest.approx(0.0, abs=0.005)
    assert model.noise < 0.03


def test_a_square_that_hardly_differs_from_the_wall_has_no_colour_of_its_own():
    images, maps, track = _track_of_a_square(WALL + [0.0, -8.0, 0.0])
    assert len(track.members) == 3
    assert learn_colour(images, maps, track, 0.15) is None
