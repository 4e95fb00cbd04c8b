"""A shift of the camera is found from edges alone, and told from a body that slides."""

import cv2
import numpy as np

from anglecam.vision.stabilise.dominant_shift import learn_shift
from anglecam.vision.stabilise.scenery_edges import is_better, scenery_edges

SIZE = (480, 360)
COUNT = 24
PATH = np.column_stack([np.linspace(0.0, 31.3, COUNT), 4.0 * np.sin(np.arange(COUNT))])
NOISE = 1.5


def _lines(image, shift, *lines):
    for (start, end), grey, width in lines:
        places = (np.round(16.0 * (np.array([start, end]) + shift)).astype(int)).tolist()
        cv2.line(image, *map(tuple, places), (grey,) * 3, width, cv2.LINE_AA, shift=4)


def _filmed(scenery=(0.0, 0.0), turning=0.0, sliding=(0.0, 0.0), seed=0):
    """Return frames of a plain room with two lines, before which a bar turns and slides."""
    rng = np.random.default_rng(seed)
    images = []
    for k in range(COUNT):
        image = np.full((SIZE[1], SIZE[0], 3), 150, np.uint8)
        camera = PATH[k] * scenery
        _lines(image, camera, (((30, 60), (150, 95)), 60, 2), (((300, 330), (430, 250)), 200, 3))
        turn = turning * np.sin(0.9 * k)
        middle = np.array([240.0, 180.0])
        arm = 70.0 * np.array([np.cos(turn), np.sin(turn)])
        _lines(image, camera + PATH[k] * sliding, ((middle - arm, middle + arm), 20, 14))
        images.append(np.clip(image + rng.normal(0.0, NOISE, image.shape), 0, 255).astype(np.uint8))
    return images


def _learnt(images):
    return learn_shift(scenery_edges(images), images)


def test_a_pan_is_found_although_most_edges_turn():
    images = _filmed(scenery=(1.0, 1.0), turning=0.5)
    shifting = _learnt(images)
    off = shifting.shifts_px - (PATH - PATH[0])
    assert np.abs(off).max() < 0.3
    moves = [shifting.at(image) for image in images]
    middle = np.array([240.0, 180.0])
    off = np.array([move.to_frame(middle) for move in moves]) - middle - (PATH - PATH[0])
    sigma = np.sqrt([np.diag(move.place_covariance(middle)) for move in moves])
    assert np.sqrt((off[1:] ** 2).mean()) < 0.1
    assert 0.3 < np.sqrt(((off[1:] / sigma[1:]) ** 2).mean()) < 1.5


def test_a_camera_at_rest_does_not_shift():
    assert _learnt(_filmed()) is None
    assert _learnt(_filmed(turning=0.5)) is None


def test_a_body_that_slides_is_no_camera():
    assert _learnt(_filmed(sliding=(1.0, 1.0))) is None
    plain = [np.where(np.abs(image.astype(int) - 150) > 60, image, 150).astype(np.uint8) for image in _filmed()]
    slides = [np.roll(image, (0, 2 * k), axis=(0, 1)) for k, image in enumerate(plain)]
    middle = [image[100:260] for image in slides]  # the bar alone
    assert _learnt(middle) is None


def test_scenery_that_is_hidden_is_unknown():
    images = _filmed(scenery=(1.0, 1.0), turning=0.5)
    shifting = _learnt(images)
    assert not shifting.at(np.full_like(images[0], 90)).known


def test_motions_of_any_kind_are_compared_in_one_currency():
    images = _filmed(scenery=(1.0, 1.0), turning=0.5)
    edges = scenery_edges(images)
    true = [np.array([[1.0, 0.0, x], [0.0, 1.0, y], [0.0, 0.0, 1.0]]) for x, y in PATH - PATH[0]]
    none = [np.eye(3)] * COUNT
    assert is_better(edges.gain(images, true, none))
    assert not is_better(edges.gain(images, none, true))
    assert not is_better(edges.gain(images, true, true))
    assert not is_better(edges.gain(images, [None] * COUNT, true))


def test_a_plain_picture_has_no_edges():
    assert scenery_edges([np.full((90, 120, 3), 128, np.uint8)] * 3) is None
